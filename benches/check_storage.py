#!/usr/bin/env python3
"""Checks surveys and jobs on S3 with a real server (moto) on loopback, of which every tenth request fails.

    cargo build --release --features storage
    python3 benches/check_storage.py target/release/tunnelstitch DIR

1. A survey whose frames are on storage is refined to the bytes of one whose frames are files.
2. A network and its job on storage, run task by task in two mirrors as on two machines, has the results of one on this machine.
3. GDAL reads a part of the panorama on storage by requests of ranges.
4. No file of the results or of the mirrors has a credential.

Prints what it found; ends with status 1 if anything differs. Needs from PyPI: moto[server], boto3, rasterio.
"""

import filecmp
import http.client
import json
import logging
import os
import random
import re
import shutil
import sqlite3
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import boto3
import rasterio
from moto.server import ThreadedMotoServer
from rasterio.session import DummySession
from rasterio.windows import Window

BUCKET, KEY_ID, SECRET = "tunnels", "AKIATESTTESTTESTTEST", "secret/Of0Nobody1Else2But3This4Test"
# Share of requests that fail.
FAILING = 0.1
# Files with times, the command line or absolute paths of a run.
OF_THE_RUN = {"run.toml", "refine.json", "survey.toml", "report.json", "report.html"}


class Proxy(BaseHTTPRequestHandler):
    """Passes requests on to the server, but for those that fail; notes ranges that are asked for."""

    protocol_version = "HTTP/1.1"
    target, chance = 0, random.Random(1)
    failed, passed, ranges = 0, 0, []

    def forward(self):
        size = int(self.headers.get("Content-Length") or 0)
        body = self.rfile.read(size)
        if self.chance.random() < FAILING:
            Proxy.failed += 1
            self.reply(503, [], b"<Error><Code>SlowDown</Code></Error>")
            return
        Proxy.passed += 1
        if "Range" in self.headers:
            Proxy.ranges.append((self.path, self.headers["Range"]))
        server = http.client.HTTPConnection("127.0.0.1", Proxy.target)
        server.request(self.command, self.path, body, dict(self.headers.items()))
        answer = server.getresponse()
        self.reply(answer.status, answer.getheaders(), answer.read())

    do_GET = do_PUT = do_POST = do_HEAD = do_DELETE = forward

    def reply(self, status, headers, body):
        self.send_response_only(status)
        for name, value in headers:
            if name.lower() not in ("content-length", "transfer-encoding", "connection"):
                self.send_header(name, value)
        length = dict((name.lower(), value) for name, value in headers).get("content-length", len(body))
        self.send_header("Content-Length", length if self.command == "HEAD" else len(body))
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(body)

    def log_message(self, *_):
        pass


def upload(client, folder, key):
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            client.upload_file(str(path), BUCKET, f"{key}/{path.relative_to(folder).as_posix()}")


def results(folder):
    """Files of a folder of results that do not tell of their run."""
    files = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(path for path in files if path.name not in OF_THE_RUN and not path.name.startswith("."))


def differing(one, two):
    names = sorted(set(results(one)) | set(results(two)))
    return [str(name) for name in names if not (
        (one / name).is_file() and (two / name).is_file() and filecmp.cmp(one / name, two / name, shallow=False))]


def main():
    program, folder = Path(sys.argv[1]).absolute(), Path(sys.argv[2]).absolute()
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    Proxy.target = server.get_host_and_port()[1]
    proxy = ThreadingHTTPServer(("127.0.0.1", 0), Proxy)
    threading.Thread(target=proxy.serve_forever, daemon=True).start()
    client = boto3.client("s3", endpoint_url=f"http://127.0.0.1:{Proxy.target}", region_name="us-east-1",
                          aws_access_key_id=KEY_ID, aws_secret_access_key=SECRET)
    client.create_bucket(Bucket=BUCKET)
    environment = {**os.environ, "AWS_ENDPOINT_URL": f"http://127.0.0.1:{proxy.server_port}", "AWS_ALLOW_HTTP": "true",
                   "AWS_ACCESS_KEY_ID": KEY_ID, "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_REGION": "us-east-1"}

    def run(*words, machine="machine-1", check=True):
        variables = {**environment, "XDG_CACHE_HOME": str(folder / machine)}
        command = [str(program), *map(str, words)]
        ended = subprocess.run(command, env=variables, capture_output=True, text=True)
        if check and ended.returncode:
            sys.exit(f"{' '.join(command)}: {ended.stderr}")
        return ended

    errors = []

    # A network on this machine, and the same on the storage.
    local = folder / "local"
    for k in (1, 2):
        run("simulate", "free", "--frames", 14, "--size", "160x120", "--supersample", 4, "--seed", k,
            "--out", local / f"K{k}", "--quiet")
    manholes = "".join(f'[[manhole]]\nid = "M{k}"\nposition_m = [{2600000 + 30 * k}.0, 1200000.0]\n' for k in range(3))
    sections = "".join(f'[[section]]\nid = "K{k}"\nsurvey = "K{k}"\nfrom = "M{k - 1}"\nto = "M{k}"\n' for k in (1, 2))
    (local / "network.toml").write_text(f'crs = "EPSG:2056"\n{manholes}{sections}')
    upload(client, local, "2026")

    # 1. Frames on storage.
    survey = folder / "survey"
    shutil.copytree(local / "K1", survey, ignore=shutil.ignore_patterns("frames"))
    toml = (survey / "survey.toml").read_text()
    (survey / "survey.toml").write_text(re.sub(r'images = ".*"', f'images = "s3://{BUCKET}/2026/K1/frames/*.png"', toml))
    for name, source in [("stored", survey), ("files", local / "K1")]:
        run("refine", source, "--out", folder / f"refined-{name}", "--quiet")
    same = ["poses.tum", "covariance.csv"]
    wrong = [name for name in same
             if not filecmp.cmp(folder / "refined-stored" / name, folder / "refined-files" / name, shallow=False)]
    errors += [f"frames on storage give another {name}" for name in wrong]
    print(f"frames on storage: {', '.join(same)} {'differ' if wrong else 'are those of files'}")

    run("plan-job", survey, "--out", folder / "job", "--steps", "refine", "--quiet")
    run("run-job", folder / "job", "--quiet")
    if differing(folder / "job/survey/refined", folder / "refined-files"):
        errors.append("a job with frames on storage has another result")

    # 2. A job on storage, of which two machines do a section each; the second draws the map.
    run("plan-job", local / "network.toml", "--out", local / "job", "--quiet")
    run("run-job", local / "job", "--quiet")
    address = f"s3://{BUCKET}/2026/job"
    run("plan-job", f"s3://{BUCKET}/2026/network.toml", "--out", address, "--quiet")
    tasks = [task["id"] for task in json.loads((local / "job/job.json").read_text())["tasks"]]
    for task in tasks:
        machine = "machine-1" if task.startswith("K1") else "machine-2"
        run("run-task", address, task, machine=machine)
    again = run("run-job", address, machine="machine-3").stdout
    if f"{len(tasks)} of {len(tasks)} tasks are done, {len(tasks)} of them before" not in again:
        errors.append(f"a third machine does not see that all is done: {again}")
    stored = folder / "machine-3/tunnelstitch/files/s3" / BUCKET / "2026/job"
    for name in ["K1/refined", "K2/refined", "K1/panorama.tif", "K2/panorama.tif", "network.gpkg"]:
        one, two = local / "job" / name, stored / name
        wrong = differing(one, two) if one.is_dir() else [] if filecmp.cmp(one, two, shallow=False) else [name]
        errors += [f"{name}: {path} differs" for path in wrong]
    print(f"a job on storage: {len(tasks)} tasks on two machines, {Proxy.failed} of {Proxy.failed + Proxy.passed} requests failed")

    # Frames that change on the storage.
    client.put_object(Bucket=BUCKET, Key="2026/K1/frames/000005.png", Body=(local / "K2/frames/000005.png").read_bytes())
    if "would run" not in run("run-job", folder / "job", "--dry-run").stdout:
        errors.append("a job does not see that a frame on storage has changed")
    frame = "2026/K2/frames/000003.png"
    client.put_object(Bucket=BUCKET, Key=frame, Body=b"no picture")
    failed = run("run-task", address, "K2.refine", machine="machine-1", check=False)
    if failed.returncode != 3 or "000003.png" not in failed.stderr:
        errors.append(f"a frame that has changed is not seen: {failed.stderr}")
    run("run-task", address, "network.map", machine="machine-3")
    database = folder / "machine-3/tunnelstitch/files/s3" / BUCKET / "2026/job/network.gpkg"
    states = [row[0] for row in sqlite3.connect(database).execute("SELECT state FROM sections")]
    print(f"after a frame has changed to no picture: {', '.join(states)}")
    if states != ["refined", "failed"]:
        errors.append(f"the map shows {states}")

    # 3. Ranges of a panorama.
    Proxy.ranges, Proxy.chance = [], random.Random()
    Proxy.chance.random = lambda: 1.0
    options = {"AWS_S3_ENDPOINT": f"127.0.0.1:{proxy.server_port}", "AWS_HTTPS": "NO", "AWS_VIRTUAL_HOSTING": "FALSE",
               "AWS_ACCESS_KEY_ID": KEY_ID, "AWS_SECRET_ACCESS_KEY": SECRET, "AWS_REGION": "us-east-1",
               "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR", "GDAL_INGESTED_BYTES_AT_OPEN": "16384"}
    large = folder / "large.tif"
    run("stitch", local / "K1", "--poses", "truth", "--px-per-metre", 400, "--out", large, "--quiet")
    client.upload_file(str(large), BUCKET, "large.tif")
    os.environ.update(options)
    with rasterio.Env(session=DummySession()), rasterio.open(f"/vsis3/{BUCKET}/large.tif") as raster:
        window = Window(raster.width // 2, raster.height // 2, 256, 256)
        part = raster.read(1, window=window)
        layout = raster.tags(ns="IMAGE_STRUCTURE").get("LAYOUT")
    with rasterio.open(large) as raster:
        if (raster.read(1, window=window) != part).any():
            errors.append("a part of the panorama on storage differs")
    asked = [tuple(int(end) for end in re.findall(r"\d+", text)) for path, text in Proxy.ranges if "large.tif" in path]
    read = sum(last - first + 1 for first, last in asked)
    print(f"GDAL ({layout}) reads 256 x 256 pixels of {large.stat().st_size >> 10} KiB by {len(asked)} ranges of {read >> 10} KiB")
    if layout != "COG" or not asked or read > large.stat().st_size / 2:
        errors.append("the panorama is not read by ranges")

    # 4. Credentials.
    found = [str(path) for path in folder.rglob("*") if path.is_file()
             and any(text.encode() in path.read_bytes() for text in (SECRET, KEY_ID))]
    keys = client.list_objects_v2(Bucket=BUCKET)["Contents"]
    found += [item["Key"] for item in keys
              if SECRET.encode() in client.get_object(Bucket=BUCKET, Key=item["Key"])["Body"].read()]
    print(f"credentials in files: {found or 'none'}")
    errors += [f"{path} has a credential" for path in found]
    server.stop()
    sys.exit("\n".join(errors) or 0)


main()
