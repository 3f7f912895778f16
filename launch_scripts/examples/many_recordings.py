"""Recordings of many days in one dataframe: python many_recordings.py runs/*."""

import sys

import pandas as pd

import impact_rig as ir

frames = {}
for path in sys.argv[1:]:
    try:
        frames[path] = ir.open_run(path).analyze().to_dataframe()
    except ir.RigError as error:
        print(f"left out: {error}", file=sys.stderr)
table = pd.concat(frames, names=["run", "sample"])
print(table["stiffness_n_per_m"].groupby("sample").agg(["count", "mean", "std"]))
