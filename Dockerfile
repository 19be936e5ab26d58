# SPDX-License-Identifier: MIT
# Pelorus with all its tools:  docker build -t pelorus . && docker run --rm -v "$PWD:/data" pelorus try drive.mcap
# Not tried: no container engine was at hand.
FROM python:3.13-slim AS build
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev
COPY . /source
RUN pip wheel --no-deps --wheel-dir /wheels /source

FROM python:3.13-slim
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(echo /wheels/pelorus_slam-*.whl)[all]" && rm -r /wheels
WORKDIR /data
ENTRYPOINT ["pelorus"]
