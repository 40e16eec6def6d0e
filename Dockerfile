# relume with what it needs to render, for a machine without Python:
#   docker build -t relume . && docker run --rm -v "$PWD:/work" relume demo -o out
FROM python:3.12-slim-bookworm AS wheel
WORKDIR /source
COPY . .
RUN pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:3.12-slim-bookworm
# Debian 12 calls its newer LLVM by a number; without it rendering is about three times slower.
RUN apt-get update \
    && { apt-get install -y --no-install-recommends libllvm19 || apt-get install -y --no-install-recommends libllvm16; } \
    && rm -rf /var/lib/apt/lists/*
COPY --from=wheel /wheels /wheels
RUN pip install --no-cache-dir "$(ls /wheels/relume-*.whl)[studio,video,lightstage]" && rm -rf /wheels
RUN useradd --create-home artist
USER artist
WORKDIR /work
ENTRYPOINT ["relume"]
CMD ["--help"]
