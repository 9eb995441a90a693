#!/usr/bin/env python3
"""Other programs on the same surveys, side by side in one run: their errors against the truth, and their time over ours.

Simulates 61 frames of a brick and of a concrete wall (about five turns), and corrects their poses by

- `tunnelstitch refine`;
- COLMAP (pycolmap): SIFT, matching of frames that are near each other, incremental mapping with the initial positions as
  priors and the given lens;
- OpenCV's Stitcher, which has no wall and no translation: rotations only;
- Open3D's colour-map optimisation, on a mesh of the tunnel and the depth that the initial poses give.

Prints for each: frames that it placed, the error at the wall (RMS over pixels of these frames: true hit of a pixel's ray
against that of the estimated pose, pixels; a common motion along and about the axis is taken off, of COLMAP's model a
similarity), for the Stitcher the error of rotations instead, wall-clock and processor time, and their ratio to ours.

Needs from PyPI: numpy, opencv-python-headless, pycolmap, open3d (a peer that is missing is left out and named), and a Rust
toolchain. `--frames 25 --size 320x240` is a quick run; `--limit` ends a peer after so many seconds.
"""
import argparse
import json
import multiprocessing
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

RADIUS_M = 3.0
PROGRAM = Path(__file__).resolve().parent.parent / "target/release/tunnelstitch"


def rotation(q):
    """Matrix of the quaternion x, y, z, w."""
    x, y, z, w = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


def poses_of(path):
    """Camera-to-world poses (R, t) of a TUM file."""
    return [(rotation(row[4:8]), row[1:4]) for row in np.loadtxt(path, ndmin=2)]


class Survey:
    """A simulated survey with a pinhole camera in a round tunnel along y."""

    def __init__(self, folder):
        self.folder = folder
        self.frames = sorted((folder / "frames").iterdir())
        self.truth = poses_of(folder / "groundtruth.tum")
        self.initial = poses_of(folder / "baseline.tum")
        camera = json.loads((folder / "camera.json").read_text())
        self.width, self.height = camera["width"], camera["height"]
        self.f, self.cx, self.cy = camera["fx"], camera["cx"], camera["cy"]

    def directions(self, columns, rows):
        """Rays of a grid of pixels in the camera, shape (rows, columns, 3)."""
        u, v = np.meshgrid(np.linspace(0, self.width - 1, columns), np.linspace(0, self.height - 1, rows))
        return np.stack([(u - self.cx) / self.f, (v - self.cy) / self.f, np.ones_like(u)], axis=-1)

    def ranges(self, pose, directions):
        """Distance to the wall along rays, in units of the rays."""
        r, t = pose
        d = directions @ r.T
        a = d[..., 0] ** 2 + d[..., 2] ** 2
        b = d[..., 0] * t[0] + d[..., 2] * t[2]
        c = t[0] ** 2 + t[2] ** 2 - RADIUS_M**2
        return (-b + np.sqrt(b * b - a * c)) / a

    def hits(self, pose, directions):
        """Angle (radians) and chainage (metres) of the wall where rays meet it."""
        r, t = pose
        x = t + self.ranges(pose, directions)[..., None] * (directions @ r.T)
        return np.arctan2(x[..., 0], x[..., 2]), x[..., 1]

    def error_px(self, poses):
        """RMS error at the wall, pixels, of the frames with a pose, without a common motion along and about the axis."""
        grid = self.directions(9, 7)
        placed = [k for k, pose in enumerate(poses) if pose is not None]
        found = [self.hits(poses[k], grid) for k in placed]
        true = [self.hits(self.truth[k], grid) for k in placed]
        turn = np.array([np.angle(np.exp(1j * (a[0] - b[0]))) for a, b in zip(found, true)])
        shift = np.array([a[1] - b[1] for a, b in zip(found, true)])
        off_m = np.stack([RADIUS_M * turn, shift])
        off_m -= np.nanmean(off_m, axis=(1, 2, 3), keepdims=True)
        range_m = np.array([self.ranges(self.truth[k], grid) * np.linalg.norm(grid, axis=-1) for k in placed])
        return float(np.sqrt(np.nanmean(np.sum(off_m**2, axis=0) * (self.f / range_m) ** 2)))


def aligned(poses, truth):
    """Poses after the similarity that fits rotations and centres best to the true ones."""
    placed = [k for k, pose in enumerate(poses) if pose is not None]
    u, _, vt = np.linalg.svd(sum(truth[k][0] @ poses[k][0].T for k in placed))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    ours = np.array([turn @ poses[k][1] for k in placed])
    true = np.array([truth[k][1] for k in placed])
    a, b = ours - ours.mean(0), true - true.mean(0)
    scale = np.sum(a * b) / np.sum(a * a)
    move = true.mean(0) - scale * ours.mean(0)
    return [pose and (turn @ pose[0], scale * turn @ pose[1] + move) for pose in poses]


def tunnelstitch(survey):
    out = survey.folder / "refined"
    subprocess.run([PROGRAM, "refine", survey.folder, "--out", out, "--fresh", "--quiet"], check=True)
    return {"poses": poses_of(out / "poses.tum")}


def colmap(survey):
    import pycolmap

    database, model = survey.folder / "colmap.db", survey.folder / "colmap"
    model.mkdir()
    options = pycolmap.ImageReaderOptions()
    options.camera_model = "PINHOLE"
    # Its pixels have their centres at (½, ½).
    options.camera_params = f"{survey.f},{survey.f},{survey.cx + 0.5},{survey.cy + 0.5}"
    pycolmap.extract_features(database, survey.folder / "frames", camera_mode=pycolmap.CameraMode.SINGLE,
                              reader_options=options)
    with pycolmap.Database.open(database) as opened:
        images = {image.name: image for image in opened.read_all_images()}
        for frame, (_, t) in zip(survey.frames, survey.initial):
            prior = pycolmap.PosePrior()
            prior.corr_data_id = images[frame.name].data_id
            prior.position, prior.position_covariance = t, np.eye(3) * 0.05**2
            prior.coordinate_system = pycolmap.PosePriorCoordinateSystem.CARTESIAN
            opened.write_pose_prior(prior)
    pycolmap.match_exhaustive(database)
    mapper = pycolmap.IncrementalPipelineOptions()
    mapper.use_prior_position = True
    mapper.ba_refine_focal_length = mapper.ba_refine_principal_point = mapper.ba_refine_extra_params = False
    models = pycolmap.incremental_mapping(database, survey.folder / "frames", model, mapper)
    poses = dict.fromkeys(frame.name for frame in survey.frames)
    if models:
        for image in max(models.values(), key=lambda found: found.num_reg_images()).images.values():
            if image.has_pose:
                world = image.cam_from_world().inverse()
                poses[image.name] = (world.rotation.matrix(), world.translation)
    poses = list(poses.values())
    if sum(pose is not None for pose in poses) < 3:
        return {"poses": [None] * len(poses), "says": "no model"}
    return {"poses": aligned(poses, survey.truth)}


def stitcher(survey):
    import cv2

    photos = [cv2.imread(str(frame)) for frame in survey.frames]
    made = cv2.Stitcher_create(cv2.Stitcher_PANORAMA)
    status = made.estimateTransform(photos)
    names = {0: None, 1: "needs more images", 2: "homographies failed", 3: "camera parameters failed"}
    if status != 0:
        return {"poses": [None] * len(photos), "says": names.get(status, str(status))}
    poses = [None] * len(photos)
    for k, camera in zip(made.component(), made.cameras()):
        poses[int(k)] = (np.asarray(camera.R, float), np.zeros(3))
    placed = [k for k, pose in enumerate(poses) if pose is not None]
    u, _, vt = np.linalg.svd(sum(survey.truth[k][0] @ poses[k][0].T for k in placed))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    cosines = [(np.trace(survey.truth[k][0].T @ turn @ poses[k][0]) - 1) / 2 for k in placed]
    off_deg = np.degrees(np.arccos(np.clip(cosines, -1, 1)))
    return {"poses": poses, "rotation_deg": float(np.sqrt(np.mean(off_deg**2)))}


def open3d(survey):
    import open3d as o3d

    intrinsic = o3d.camera.PinholeCameraIntrinsic(survey.width, survey.height, survey.f, survey.f, survey.cx, survey.cy)
    directions = survey.directions(survey.width, survey.height)
    images, cameras = [], []
    for frame, pose in zip(survey.frames, survey.initial):
        # The rays have length 1 along the optical axis, so the range in their units is the depth.
        depth = o3d.geometry.Image(survey.ranges(pose, directions).astype(np.float32))
        colour = o3d.io.read_image(str(frame))
        if np.asarray(colour).ndim == 2:
            colour = o3d.geometry.Image(np.repeat(np.asarray(colour)[..., None], 3, axis=2).copy())
        images.append(o3d.geometry.RGBDImage.create_from_color_and_depth(
            colour, depth, depth_scale=1.0, depth_trunc=10.0, convert_rgb_to_intensity=False))
        camera = o3d.camera.PinholeCameraParameters()
        camera.intrinsic = intrinsic
        extrinsic = np.eye(4)
        extrinsic[:3, :3], extrinsic[:3, 3] = pose[0].T, -pose[0].T @ pose[1]
        camera.extrinsic = extrinsic
        cameras.append(camera)
    trajectory = o3d.camera.PinholeCameraTrajectory()
    trajectory.parameters = cameras
    chainages = [t[1] for _, t in survey.initial]
    mesh = tunnel_mesh(o3d, min(chainages) - 2, max(chainages) + 2)
    option = o3d.pipelines.color_map.RigidOptimizerOption(maximum_iteration=100, maximum_allowable_depth=10.0)
    _, trajectory = o3d.pipelines.color_map.run_rigid_optimizer(mesh, images, trajectory, option)
    poses = []
    for camera in trajectory.parameters:
        world = np.linalg.inv(np.asarray(camera.extrinsic))
        poses.append((world[:3, :3], world[:3, 3]))
    return {"poses": poses}


def tunnel_mesh(o3d, low_m, high_m, step_m=0.03):
    """The inside of the tunnel as triangles of `step_m`."""
    around, along = int(2 * np.pi * RADIUS_M / step_m), int((high_m - low_m) / step_m)
    theta, h = np.meshgrid(np.arange(around) * 2 * np.pi / around, low_m + np.arange(along) * step_m)
    points = np.stack([RADIUS_M * np.sin(theta), h, RADIUS_M * np.cos(theta)], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(around), np.arange(along - 1))
    a, b = j * around + i, j * around + (i + 1) % around
    faces = np.concatenate([np.stack([a, b, a + around], -1), np.stack([b, b + around, a + around], -1)]).reshape(-1, 3)
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(points), o3d.utility.Vector3iVector(faces))
    mesh.compute_vertex_normals()
    return mesh


def measure(peer, survey, queue):
    """Runs a peer, and puts its result with its times into the queue."""
    for stream in (1, 2):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
    since = time.monotonic()
    try:
        result = peer(survey)
    except ImportError as error:
        result = {"poses": [], "says": f"left out: {error}"}
    except Exception as error:  # Whatever a peer does is its result.
        result = {"poses": [], "says": f"{type(error).__name__}: {error}"}
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    result["wall_s"] = time.monotonic() - since
    result["processor_s"] = sum(usage.ru_utime + usage.ru_stime for usage in used)
    queue.put(result)


def run(peer, survey, limit_s):
    """The result of a peer in a process of its own, or what became of it."""
    queue = multiprocessing.get_context("spawn").Queue()
    process = multiprocessing.get_context("spawn").Process(target=measure, args=(peer, survey, queue))
    since = time.monotonic()
    process.start()
    result = None
    while result is None and process.is_alive() and time.monotonic() - since < limit_s:
        try:
            result = queue.get(timeout=1)
        except Exception:
            pass
    spent = time.monotonic() - since
    if result is None and process.is_alive():
        process.kill()
        return {"poses": [], "says": f"ended after {limit_s:.0f} s", "wall_s": spent, "processor_s": float("nan")}
    process.join(30)
    process.kill()
    lost = {"poses": [], "says": "crashed", "wall_s": spent, "processor_s": float("nan")}
    return result or lost


PEERS = {
    "tunnelstitch": tunnelstitch,
    "COLMAP, position priors": colmap,
    "OpenCV Stitcher": stitcher,
    "Open3D colour map": open3d,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--frames", type=int, default=61)
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--walls", default="brick,concrete")
    parser.add_argument("--limit", type=float, default=1800, help="seconds after which a peer is ended")
    parser.add_argument("--program", type=Path, help="tunnelstitch [the release build, which is made]")
    arguments = parser.parse_args()
    global PROGRAM
    if arguments.program:
        PROGRAM = arguments.program.resolve()
    else:
        subprocess.run(["cargo", "build", "--release", "--quiet"], check=True, cwd=PROGRAM.parent.parent.parent)
    os.environ["PEERS_PROGRAM"] = str(PROGRAM)
    for wall in arguments.walls.split(","):
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch) / wall
            subprocess.run([PROGRAM, "simulate", "free", "--wall", wall, "--frames", str(arguments.frames), "--size",
                            arguments.size, "--seed", "1", "--quiet", "--out", folder], check=True)
            survey = Survey(folder)
            print(f"{wall}, {len(survey.frames)} frames of {arguments.size}; initial poses "
                  f"{survey.error_px(survey.initial):.2f} px off", flush=True)
            print(f"  {'':24}{'frames':>7}{'error':>14}{'wall s':>9}{'cpu s':>9}{'cpu/ours':>10}")
            ours = None
            for name, peer in PEERS.items():
                result = run(peer, survey, arguments.limit)
                ours = ours or result["processor_s"]
                placed = sum(pose is not None for pose in result["poses"])
                if "rotation_deg" in result:
                    error = f"{result['rotation_deg']:.2f} deg"
                else:
                    error = f"{survey.error_px(result['poses']):.3f} px" if placed else "-"
                print(f"  {name:24}{placed:>7}{error:>14}{result['wall_s']:>9.1f}{result['processor_s']:>9.1f}"
                      f"{result['processor_s'] / ours:>10.2f}  {result.get('says') or ''}", flush=True)


PROGRAM = Path(os.environ.get("PEERS_PROGRAM", PROGRAM))

if __name__ == "__main__":
    sys.exit(main())
