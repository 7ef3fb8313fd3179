# An image that runs headless: docker build -t chmarl-pb . && docker run --rm -v "$PWD/out:/out" chmarl-pb demo --out /out
# With the learners: docker build --build-arg EXTRAS='[train]' -t chmarl-pb . Everything comes as ready-made packages.
FROM python:3.11-slim

ARG EXTRAS=""
RUN useradd --create-home user
COPY . /src
RUN pip install --no-cache-dir "/src${EXTRAS}" && rm -rf /src
USER user
WORKDIR /home/user
# The first thing that runs compiles machine code, so it is kept in the image.
RUN chmarl-pb doctor
ENTRYPOINT ["chmarl-pb"]
CMD ["--help"]
