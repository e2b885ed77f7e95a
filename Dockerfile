# docker build -t brake-ecu .
# docker run --network host --ulimit rtprio=50 --ulimit memlock=-1 brake-ecu run --config suv -i socketcan -c can0
FROM python:3.13-slim-bookworm
RUN useradd --create-home brake && install -d -o brake /opt/brake-ecu
USER brake
RUN --mount=type=bind,target=/source /source/tools/install-onboard.sh /opt/brake-ecu
ENTRYPOINT ["/opt/brake-ecu/bin/brake-ecu"]
