# The course in a container: grading a class on macOS and Windows, Codespaces, a server for a class.
#   docker build -t lbw --build-arg TORCH_INDEX=URL .
#   docker run -it -p 8888:8888 --cap-add SYS_ADMIN --security-opt seccomp=unconfined lbw
# x86-64 only: PyBullet has no wheels for Linux on ARM. The two options let bubblewrap start; without
# them the grader says that its sandbox does not. Built with Buildah on a stand-in for the first line,
# Debian 12 with CPython 3.11.7 in /usr/local: see tasks/README.md.
FROM python:3.11-slim-bookworm
RUN apt-get update && apt-get install -y --no-install-recommends \
        bubblewrap chromium fonts-dejavu-core git make \
    && rm -rf /var/lib/apt/lists/*
# Outside the kit's folder, which an editor replaces by the reader's own.
ENV VENV=/opt/lbw PATH=/opt/lbw/bin:$PATH JUPYTER_CONFIG_PATH=/lbw/.jupyter
ARG TORCH_INDEX=
WORKDIR /lbw
COPY Makefile requirements.txt requirements-lock.txt ./
RUN make /opt/lbw/ready TORCH_INDEX=$TORCH_INDEX PYTHON=/usr/local/bin/python3
COPY . .
EXPOSE 8888
CMD ["jupyter", "lab", "--ip=0.0.0.0", "--no-browser", "--allow-root", "--notebook-dir=."]
