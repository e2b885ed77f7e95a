# docker build -t brake-ecu .
# docker run --network host --ulimit rtprio=50 --ulimit memlock=-1 -v brake-ecu:/home/brake brake-ecu \
#     run --config suv -i socketcan -c can0 --state /home/brake/state
FROM python:3.13-slim-bookworm AS build
RUN apt-get -qq update && apt-get -qq install --no-install-recommends gcc libc6-dev >/dev/null
RUN --mount=type=bind,target=/source /source/tools/install-onboard.sh /opt/brake-ecu

FROM python:3.13-slim-bookworm
RUN useradd --create-home brake
COPY --from=build /opt/brake-ecu /opt/brake-ecu
USER brake
# What is learned (--state) and recorded outlives the container.
VOLUME /home/brake
# Cycles advance; the ring alone is read, no kernel is called.
HEALTHCHECK --interval=30s --timeout=5s --start-period=60s \
    CMD /opt/brake-ecu/bin/python -P -m ecu.watch.health
ENTRYPOINT ["/opt/brake-ecu/bin/brake-ecu"]
