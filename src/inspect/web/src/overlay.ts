/** Marks and measurements drawn over the view. */
import { PerspectiveCamera, Vector3 } from "three";
import type { Wall, WallPlace } from "./wall";

export interface Shape {
  places: WallPlace[];
  label: string;
  chosen: boolean;
}

const SVG = "http://www.w3.org/2000/svg";
/** Maximum distance of drawn marks, radii. */
const MAX_DISTANCE_RADII = 30;
/** Number of segments by which a line follows the wall. */
const SEGMENTS = 16;

export class Overlay {
  constructor(
    private readonly root: SVGElement,
    private readonly wall: Wall,
    private readonly camera: PerspectiveCamera,
  ) {}

  draw(shapes: Shape[]): void {
    this.root.replaceChildren(...shapes.flatMap((shape) => this.shape(shape)));
  }

  private shape({ places, label, chosen }: Shape): Element[] {
    const drawn: Element[] = [];
    const [first, second] = places;
    if (second) {
      const line = Array.from({ length: SEGMENTS + 1 }, (_, k) => {
        const share = k / SEGMENTS;
        return this.project({ s: first.s + share * (second.s - first.s), h: first.h + share * (second.h - first.h) });
      });
      for (let k = 1; k < line.length; k++) {
        const [a, b] = [line[k - 1], line[k]];
        if (a && b) drawn.push(element("line", { x1: a[0], y1: a[1], x2: b[0], y2: b[1] }));
      }
    }
    const seen = places.map((place) => this.project(place)).filter((at) => at !== null);
    for (const [cx, cy] of seen) drawn.push(element("circle", { cx, cy, r: 5 }, chosen ? "chosen" : ""));
    if (seen.length > 0 && label) {
      const text = element("text", { x: seen[0][0] + 10, y: seen[0][1] - 8 });
      text.textContent = label;
      drawn.push(text);
    }
    return drawn;
  }

  /** Screen position of a wall position, or null if it is behind the camera or too far. */
  private project(place: WallPlace): [number, number] | null {
    const x = this.wall.point(place);
    if (x.distanceTo(this.camera.position) > MAX_DISTANCE_RADII * this.wall.radius) return null;
    const inCamera = x.clone().applyMatrix4(this.camera.matrixWorldInverse);
    if (inCamera.z > -this.camera.near) return null;
    const { x: right, y: up } = new Vector3().copy(inCamera).applyMatrix4(this.camera.projectionMatrix);
    if (Math.max(Math.abs(right), Math.abs(up)) > 2) return null;
    return [((right + 1) / 2) * this.root.clientWidth, ((1 - up) / 2) * this.root.clientHeight];
  }
}

function element(name: string, numbers: Record<string, number>, className = ""): Element {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(numbers)) made.setAttribute(key, value.toFixed(1));
  if (className) made.setAttribute("class", className);
  return made;
}
