# docker build -t cosserat . && docker run cosserat                                        the demo
# docker build --target test -t cosserat-test . && docker run cosserat-test pytest         the tests
# On Debian's development branch, with a newer dolfinx: add --build-arg SUITE=sid
ARG SUITE=trixie
FROM debian:${SUITE} AS run

# The long step comes first and depends on nothing but two lists, so a change of the code does not repeat it.
COPY .ci/dpkg.cfg /etc/dpkg/dpkg.cfg.d/image
COPY .ci/debian-packages.txt /tmp/
RUN apt-get update \
 && sed 's/#.*//' /tmp/debian-packages.txt \
  | DEBIAN_FRONTEND=noninteractive xargs apt-get install -y --no-install-recommends make \
 && rm -rf /var/lib/apt/lists/* /var/cache/apt/*.bin \
 && useradd --create-home rod \
 && install --directory --owner=rod --group=rod /home/rod/cosserat

USER rod
WORKDIR /home/rod/cosserat
COPY --chown=rod:rod . .
RUN PIP_NO_CACHE_DIR=1 make setup EXTRAS=pictures,data

# What the Makefile sets, for commands that do not go through it; the comments are there.
ENV PATH=/home/rod/cosserat/.venv/bin:$PATH \
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 OMPI_MCA_btl=^tcp,ofi \
    MPLBACKEND=Agg VTK_DEFAULT_OPENGL_WINDOW=vtkEGLRenderWindow
CMD ["make", "demo"]

FROM run AS test
RUN python -m pip install --no-cache-dir --constraint .venv/constraints.txt --editable '.[test]'

# what a build without --target gives
FROM run
