# docker build -t brake-ecu .
# docker run --network host --ulimit rtprio=50 --ulimit memlock=-1 brake-ecu run --config suv -i socketcan -c can0
FROM python:3.13-slim-bookworm
RUN useradd --create-home brake
# Root's, but for the compiled kernels, which numba has to be able to write.
RUN --mount=type=bind,target=/source /source/tools/install-onboard.sh /opt/brake-ecu && chown -R brake: /opt/brake-ecu/cache
USER brake
# Cycles advance; the ring alone is read, no kernel is called.
HEALTHCHECK --interval=30s --timeout=5s --start-period=60s \
    CMD NUMBA_DISABLE_JIT=1 /opt/brake-ecu/bin/python -P -m ecu.watch.health
ENTRYPOINT ["/opt/brake-ecu/bin/brake-ecu"]
