# The command and the Python package: docker build -t corsmal-feat . && docker run -v $PWD:/data corsmal-feat extract --in audio --out feats.npz
FROM rust:1-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends build-essential python3-venv \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY . .
RUN cargo install --locked --path crates/cli --features nets,cloud --root /installed
RUN python3 -m venv /build && /build/bin/pip install "maturin>=1.9,<2" \
    && /build/bin/maturin build --release --locked --out /wheels

FROM python:3.13-slim-bookworm
COPY --from=build /installed/bin/corsmal-feat /usr/local/bin/
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir /wheels/*.whl && rm -r /wheels
WORKDIR /data
ENTRYPOINT ["corsmal-feat"]
