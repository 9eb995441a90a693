#!/usr/bin/env python3
"""Checks through GDAL (pyogrio) and SQLite that the map of a network is a GeoPackage with all that it should have.

    python3 benches/check_network_map.py target/release/tunnelstitch DIR

Simulates two sections, of which one has a frame that is no picture, runs their job, and reads its map: coordinate system,
geometries, states and links. Ends with status 1 if anything is missing.

Needs from PyPI: pyogrio.
"""

import sqlite3
import subprocess
import sys
from pathlib import Path

import pyogrio

NETWORK = """crs = "EPSG:2056"
[[manhole]]
id = "M1"
position_m = [2600000, 1200000]
[[manhole]]
id = "M2"
position_m = [2600030, 1200040]
[[section]]
id = "K1"
survey = "K1"
from = "M1"
to = "M2"
[[section]]
id = "K2"
survey = "K2"
from = "M2"
to = "M1"
"""


def main():
    program, folder = sys.argv[1], Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    for name in ["K1", "K2"]:
        subprocess.run([program, "simulate", "free", "--frames", "14", "--size", "160x120", "--supersample", "4",
                        "--out", folder / name, "--force", "--quiet"], check=True)
    (folder / "K2/frames/000003.png").write_text("no picture")
    (folder / "network.toml").write_text(NETWORK)
    job = folder / "job"
    subprocess.run([program, "plan-job", folder / "network.toml", "--out", job, "--quiet"], check=True)
    subprocess.run([program, "run-job", job, "--quiet"], check=False)
    path = job / "network.gpkg"
    integrity = sqlite3.connect(path).execute("PRAGMA integrity_check").fetchone()[0]
    found = {"integrity": integrity}
    for name, kind in pyogrio.list_layers(path):
        info = pyogrio.read_info(path, layer=name)
        found[name] = (kind, info["crs"], info["features"])
        print(f"{name}: {kind}, {info['crs']}, {info['features']} features, {', '.join(info['fields'])}")
    meta, _, _, columns = pyogrio.raw.read(path, layer="sections")
    sections = [dict(zip(meta["fields"], row)) for row in zip(*columns)]
    found["states"] = [section["state"] for section in sections]
    found["report"] = (job / sections[0]["report"]).is_file()
    expected = {
        "integrity": "ok",
        "sections": ("LineString", "EPSG:2056", 2),
        "manholes": ("Point", "EPSG:2056", 2),
        "defects": ("Point", "EPSG:2056", 0),
        "states": ["refined", "failed"],
        "report": True,
    }
    print(f"states: {', '.join(found['states'])}")
    if found != expected:
        sys.exit(f"found {found}, expected {expected}")


main()
