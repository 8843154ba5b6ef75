#!/usr/bin/env python3
"""Fits mean and projection of a model on places that were visited several times, and writes them into its description.

Reads the lines of `recall features` (place, pooled features of one visit) from files or standard input. The differences
between the visits of a place (light, heading, a step aside) give the within-place scatter; it is whitened, and of what
is then left between places the strongest directions are kept (as Radenovic et al., TPAMI 2018, section 4.3, do with
pairs).

Usage: pip install numpy && python3 fit_projection.py MODEL.json FEATURES...
"""

import argparse
import fileinput
import json
from pathlib import Path

import numpy as np

# With all of the mean subtracted, the direction of an ordinary place is left to chance; a small
# rest keeps ordinary places alike.
MEAN_SHARE = 0.97
# Added to the eigenvalues of the within-place scatter, as a share of their mean.
REGULARISATION = 0.1


def read(files):
    """Features by place, places in the order of their names."""
    places = {}
    for line in fileinput.input(files):
        visit = json.loads(line)
        places.setdefault(visit["place"], []).append(visit["features"])
    return [np.array(places[name]) for name in sorted(places) if len(places[name]) > 1]


def fit(places, dimension):
    """Mean [channels] and projection [dimension, channels]."""
    mean = MEAN_SHARE * np.concatenate(places).mean(0)
    centres = np.array([visits.mean(0) for visits in places])
    within = np.concatenate([visits - centre for visits, centre in zip(places, centres)])
    values, vectors = np.linalg.eigh(within.T @ within / len(within))
    whiten = vectors @ np.diag((values + REGULARISATION * values.mean()) ** -0.5) @ vectors.T
    between = (centres - mean) @ whiten
    _, directions = np.linalg.eigh(between.T @ between)
    projection = (whiten @ directions[:, ::-1][:, :dimension]).T
    # The length of a projected vector means nothing; about 1 is handy.
    return mean, projection / np.linalg.norm((centres - mean) @ projection.T, axis=1).mean()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("description", type=Path)
    parser.add_argument("features", nargs="*")
    arguments = parser.parse_args()
    description = json.loads(arguments.description.read_text())
    places = read(arguments.features)
    mean, projection = fit(places, description["dimension"])
    description["mean"] = [round(float(value), 6) for value in mean]
    description["projection"] = arguments.description.with_suffix(".projection").name
    arguments.description.with_suffix(".projection").write_bytes(projection.astype("<f4").tobytes())
    lines = [f"  {json.dumps(key)}: {json.dumps(value)}" for key, value in description.items()]
    arguments.description.write_text("{\n" + ",\n".join(lines) + "\n}\n")
    print(f"{len(places)} places, {sum(map(len, places))} visits, projection of {projection.shape}")


if __name__ == "__main__":
    main()
