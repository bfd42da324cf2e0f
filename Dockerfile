# One file, a target a service: docker build --target sim .
# A service's dependencies are a layer below the source, so that a change of the source rebuilds in
# seconds. Written for the classic builder too (no RUN --mount), which builds every stage above the
# target: the light ones come first.

FROM python:3.11-slim-bookworm AS base
ENV PATH=/opt/venv/bin:$PATH \
    PIP_NO_CACHE_DIR=1 \
    PIP_DISABLE_PIP_VERSION_CHECK=1 \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    AUTOCOMPLETE_CONNECT=tcp/router:7447
RUN python -m venv /opt/venv && useradd --system --create-home --uid 10001 autocomplete
WORKDIR /app
COPY pyproject.toml constraints.txt ./
COPY deploy/requirements.py deploy/install deploy/
RUN deploy/install 'setuptools>=77'

FROM base AS synthesis
RUN deploy/install --extra synthesis
COPY . .
RUN deploy/install --source
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "synthesis"]
ENTRYPOINT ["autocomplete", "run", "synthesis"]

FROM base AS autopilot
RUN deploy/install --extra autopilot
COPY . .
RUN deploy/install --source
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "autopilot"]
ENTRYPOINT ["autocomplete", "run", "autopilot"]

FROM base AS recorder
RUN mkdir /recordings && chown autocomplete /recordings
RUN deploy/install --extra recorder
COPY . .
RUN deploy/install --source
ENV AUTOCOMPLETE_RECORDER_FOLDER=/recordings
VOLUME /recordings
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "recorder"]
ENTRYPOINT ["autocomplete", "run", "recorder"]

FROM base AS operator
RUN deploy/install --extra operator
COPY . .
RUN deploy/install --source
# A container has no screen: pads are read without one.
ENV SDL_VIDEODRIVER=dummy SDL_AUDIODRIVER=dummy
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "operator"]
ENTRYPOINT ["autocomplete", "run", "operator"]

FROM base AS localizer
RUN deploy/install --extra localizer
COPY . .
RUN deploy/install --source
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "localizer"]
ENTRYPOINT ["autocomplete", "run", "localizer"]

FROM base AS classifier
RUN deploy/install --extra classifier
COPY . .
RUN deploy/install --source
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "classifier"]
ENTRYPOINT ["autocomplete", "run", "classifier"]

FROM base AS sim
# EGL on Mesa's software renderer; a graphics card is used where one is passed in.
RUN apt-get update \
 && apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri \
 && rm -rf /var/lib/apt/lists/*
RUN deploy/install --extra sim
COPY . .
RUN deploy/install --source
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "sim"]
ENTRYPOINT ["autocomplete", "run", "sim"]

FROM node:22-bookworm-slim AS console
WORKDIR /console
COPY services/overlay/console/package.json services/overlay/console/package-lock.json ./
RUN npm ci --no-audit --no-fund
COPY services/overlay/console/ ./
RUN npm run build

FROM base AS overlay
RUN deploy/install --extra overlay
COPY . .
COPY --from=console /console/dist services/overlay/console/dist
RUN deploy/install --source
EXPOSE 8080
USER autocomplete
HEALTHCHECK --interval=30s --timeout=10s --start-period=60s CMD ["nice", "autocomplete", "alive", "overlay"]
ENTRYPOINT ["autocomplete", "run", "overlay"]
