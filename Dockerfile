# romdam with its extras for records and pictures: docker build -t romdam . ; docker run --rm -v "$PWD:/job" romdam run job.yaml --out results
FROM python:3.11-slim
RUN apt-get update \
    && apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri libxrender1 \
    && rm -rf /var/lib/apt/lists/*
COPY . /src
RUN pip install --no-cache-dir "/src[suites,view]" && rm -rf /src
# what is compiled and reduced at the first start goes where any user may write
ENV NUMBA_CACHE_DIR=/tmp/numba XDG_CACHE_HOME=/tmp/cache MPLCONFIGDIR=/tmp/matplotlib
WORKDIR /job
ENTRYPOINT ["romdam"]
CMD ["--help"]
