/** Trajectory and camera frusta as lines in the world. */
import {
  BufferGeometry, Color, Float32BufferAttribute, Group, Line, LineBasicMaterial, LineSegments,
  Quaternion, Vector3,
} from "three";
import type { Layer, Tunnel } from "./tunnel";

/** Length of a frustum's edges, as a share of the radius. */
const EDGE_RADII = 0.12;
/** Maximum number of frusta. */
const MAX_FRUSTA = 2000;

export function camerasOf(tunnel: Tunnel, layer: Layer, radius: number): Group {
  const group = new Group();
  const centres = layer.poses.map((pose) => new Vector3(pose[0], pose[1], pose[2]));
  // Positions relative to the first: exact in single precision.
  const origin = centres[0]?.clone() ?? new Vector3();
  group.position.copy(origin);
  const path = new BufferGeometry().setFromPoints(centres.map((centre) => centre.clone().sub(origin)));
  group.add(new Line(path, new LineBasicMaterial({ color: new Color("#ffb02e") })));
  const step = Math.max(1, Math.ceil(layer.poses.length / MAX_FRUSTA));
  const ends: number[] = [];
  layer.poses.forEach((pose, k) => {
    if (k % step !== 0) return;
    const turn = new Quaternion(pose[3], pose[4], pose[5], pose[6]);
    const apex = centres[k].clone().sub(origin);
    const corners = tunnel.corners.map((corner) =>
      new Vector3(...corner).applyQuaternion(turn).multiplyScalar(EDGE_RADII * radius).add(apex),
    );
    corners.forEach((corner, c) => {
      ends.push(...apex.toArray(), ...corner.toArray());
      ends.push(...corner.toArray(), ...corners[(c + 1) % corners.length].toArray());
    });
  });
  const frusta = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(ends, 3));
  group.add(new LineSegments(frusta, new LineBasicMaterial({ color: new Color("#5ad1ff"), transparent: true, opacity: 0.7 })));
  return group;
}

export function disposeCameras(group: Group): void {
  group.removeFromParent();
  for (const child of group.children) {
    if (child instanceof Line) {
      child.geometry.dispose();
      (child.material as LineBasicMaterial).dispose();
    }
  }
}
