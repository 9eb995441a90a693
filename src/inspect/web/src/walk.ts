/**
 * Camera control by keys, mouse, wheel and touch, and the automatic ride along the axis. The camera
 * never passes through the wall.
 */
import { Matrix4, PerspectiveCamera, Vector3 } from "three";
import type { Station, Wall, WallPlace } from "./wall";

/** Minimum distance of the camera from the wall, as a share of the radius. */
const MARGIN_RADII = 0.04;
const TURN_RAD_PER_PX = 0.003;
const TURN_RAD_PER_S = 1.2;
/** Speed factor of the shift key. */
const FAST_FACTOR = 4;
/** Maximum movement of a click, pixels. */
const CLICK_PX = { mouse: 4, touch: 12 };
/** Forward movement when the distance of two fingers doubles, radii. */
const PINCH_RADII = 0.7;
/** Sideways movement per pixel of two fingers, radii. */
const PAN_RADII = 0.004;
/** Maximum distance of the initial view target, radii. */
const MAX_AHEAD_RADII = 6;

const MOVES: Record<string, [number, number, number]> = {
  KeyW: [0, 0, 1], KeyS: [0, 0, -1], KeyA: [-1, 0, 0], KeyD: [1, 0, 0], KeyE: [0, 1, 0], KeyQ: [0, -1, 0],
};
const TURNS: Record<string, [number, number]> = {
  ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1],
};

export class Walk {
  /** Speed, metres per second. */
  speed: number;
  riding = false;
  /** Called with the position of a click, pixels of the view. */
  onClick: (x: number, y: number) => void = () => {};
  /** Position of the camera. */
  private readonly eye: Vector3;
  /** View angles relative to the axis, right and up, radians. */
  private yaw = 0;
  private pitch = 0;
  private readonly pressed = new Set<string>();
  /** Positions of pressed fingers or of the mouse. */
  private readonly touches = new Map<number, [number, number]>();
  /** Movement since the press, pixels. */
  private moved = 0;
  private changed = true;

  constructor(
    private readonly wall: Wall,
    private readonly camera: PerspectiveCamera,
    private readonly view: HTMLElement,
  ) {
    this.speed = wall.radius * 0.6;
    camera.near = wall.radius * MARGIN_RADII * 0.2;
    camera.far = (wall.chainage[1] - wall.chainage[0]) * 2 + wall.radius * 20;
    // Start inside the tunnel, surrounded by wall.
    const [from, to] = wall.chainage;
    const start = from + Math.min(wall.radius, 0.2 * (to - from));
    this.eye = wall.station(start).centre;
    // View along a long tunnel, but not out of its end.
    const ahead = Math.min(MAX_AHEAD_RADII * wall.radius, 0.3 * (to - start));
    const there = wall.station(start + ahead);
    this.lookFrom(wall.station(start), wall.towards(there, there.right).place);
    this.listen();
  }

  get station(): Station {
    return this.wall.stationOf(this.eye);
  }

  /** Radial distance of the camera from the wall in its section. */
  get clearance(): number {
    const station = this.station;
    const offset = this.eye.clone().sub(station.centre);
    return this.wall.towards(station, offset).distance - offset.length();
  }

  /** Moves to the axis and looks at a wall position. */
  lookAt(place: WallPlace): void {
    const station = this.wall.station(Math.min(Math.max(place.h, this.wall.chainage[0]), this.wall.chainage[1]));
    this.lookFrom(station, place);
  }

  private lookFrom(station: Station, place: WallPlace): void {
    this.eye.copy(station.centre);
    this.turnTo(station, this.wall.point(place).sub(this.eye));
  }

  /** Presses or releases a key. */
  hold(key: string, down: boolean): void {
    if (down) this.pressed.add(key);
    else this.pressed.delete(key);
  }

  /** Looks along the axis. */
  lookAlong(): void {
    [this.yaw, this.pitch, this.changed] = [0, 0, true];
  }

  /** Advances the motion by a time step; returns true if the view changed. */
  update(seconds: number): boolean {
    const station = this.station;
    const [look, right, up] = this.axes(station);
    const step = new Vector3();
    const turn = [0, 0];
    for (const key of this.pressed) {
      const move = MOVES[key];
      if (move) step.addScaledVector(right, move[0]).addScaledVector(up, move[1]).addScaledVector(look, move[2]);
      const angles = TURNS[key];
      if (angles) [turn[0], turn[1]] = [turn[0] + angles[0], turn[1] + angles[1]];
    }
    const fast = this.pressed.has("ShiftLeft") || this.pressed.has("ShiftRight") ? FAST_FACTOR : 1;
    if (step.lengthSq() > 0) this.go(step.setLength(this.speed * fast * seconds));
    if (turn[0] || turn[1]) this.turn(turn[0] * TURN_RAD_PER_S * seconds, turn[1] * TURN_RAD_PER_S * seconds);
    if (this.riding) this.rideOn(station, this.speed * fast * seconds);
    const changed = this.changed;
    if (changed) this.place();
    this.changed = false;
    return changed;
  }

  private go(step: Vector3): void {
    const next = this.eye.clone().add(step);
    this.eye.copy(this.wall.inside(next, this.wall.radius * MARGIN_RADII));
    this.changed = true;
  }

  private rideOn(station: Station, metres: number): void {
    const backwards = Math.abs(this.yaw) > Math.PI / 2;
    const end = this.wall.chainage[backwards ? 0 : 1];
    const left = Math.abs(end - station.h);
    if (left < 1e-6) this.riding = false;
    const along = Math.min(metres, left) * (backwards ? -1 : 1);
    const next = this.wall.station(station.h + along);
    const offset = this.eye.clone().sub(station.centre);
    // Keep the position relative to the section.
    this.eye.copy(next.centre);
    for (const axis of ["up", "right"] as const) this.eye.addScaledVector(next[axis], offset.dot(station[axis]));
    this.go(new Vector3());
  }

  private turn(yaw: number, pitch: number): void {
    this.yaw = Math.atan2(Math.sin(this.yaw + yaw), Math.cos(this.yaw + yaw));
    this.pitch = Math.min(Math.max(this.pitch + pitch, -Math.PI / 2), Math.PI / 2);
    this.changed = true;
  }

  private turnTo(station: Station, direction: Vector3): void {
    const [x, y, z] = [direction.dot(station.right), direction.dot(station.up), direction.dot(station.along)];
    this.pitch = Math.atan2(y, Math.hypot(x, z));
    // Straight up or down the yaw is undefined.
    this.yaw = Math.hypot(x, z) > 1e-6 * Math.abs(y) ? Math.atan2(x, z) : Math.PI / 2;
    this.changed = true;
  }

  /** View axes: forward, right and up. */
  private axes(station: Station): [Vector3, Vector3, Vector3] {
    const [sin, cos] = [Math.sin(this.yaw), Math.cos(this.yaw)];
    const level = station.along.clone().multiplyScalar(cos).addScaledVector(station.right, sin);
    const look = level.clone().multiplyScalar(Math.cos(this.pitch)).addScaledVector(station.up, Math.sin(this.pitch));
    const right = station.right.clone().multiplyScalar(cos).addScaledVector(station.along, -sin);
    return [look, right, right.clone().cross(look)];
  }

  private place(): void {
    const [look, right, up] = this.axes(this.station);
    this.camera.position.copy(this.eye);
    this.camera.quaternion.setFromRotationMatrix(new Matrix4().makeBasis(right, up, look.negate()));
    this.camera.updateMatrixWorld();
  }

  private listen(): void {
    const view = this.view;
    const typing = (event: Event) => event.target instanceof HTMLElement && event.target.closest("input, textarea, select, dialog");
    window.addEventListener("keydown", (event) => {
      if (typing(event) || event.ctrlKey || event.metaKey || event.altKey) return;
      if (MOVES[event.code] || TURNS[event.code] || event.code.startsWith("Shift")) this.pressed.add(event.code);
      if (TURNS[event.code]) event.preventDefault();
    });
    window.addEventListener("keyup", (event) => this.pressed.delete(event.code));
    window.addEventListener("blur", () => this.pressed.clear());
    view.addEventListener("wheel", (event) => {
      event.preventDefault();
      const [least, most] = [this.wall.radius * 0.02, this.wall.radius * 20];
      this.speed = Math.min(Math.max(this.speed * Math.pow(1.2, -Math.sign(event.deltaY)), least), most);
    }, { passive: false });
    view.addEventListener("pointerdown", (event) => {
      view.focus();
      if (document.pointerLockElement !== view) view.setPointerCapture(event.pointerId);
      this.touches.set(event.pointerId, [event.clientX, event.clientY]);
      this.moved = this.touches.size > 1 ? Infinity : 0;
    });
    view.addEventListener("pointermove", (event) => this.drag(event));
    const end = (event: PointerEvent) => {
      const pressed = this.touches.delete(event.pointerId);
      if (!pressed || event.type === "pointercancel" || this.moved > clickPx(event)) return;
      const locked = document.pointerLockElement === view;
      this.onClick(locked ? view.clientWidth / 2 : event.clientX, locked ? view.clientHeight / 2 : event.clientY);
    };
    view.addEventListener("pointerup", end);
    view.addEventListener("pointercancel", end);
  }

  private drag(event: PointerEvent): void {
    if (document.pointerLockElement === this.view) {
      this.turn(event.movementX * TURN_RAD_PER_PX, -event.movementY * TURN_RAD_PER_PX);
      return;
    }
    const before = this.touches.get(event.pointerId);
    if (!before) return;
    const [dx, dy] = [event.clientX - before[0], event.clientY - before[1]];
    if (Math.hypot(dx, dy) + this.moved <= clickPx(event)) return;
    this.touches.set(event.pointerId, [event.clientX, event.clientY]);
    this.moved += Math.hypot(dx, dy);
    const other = [...this.touches].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const [look, right, up] = this.axes(this.station);
      const apart = (x: number, y: number) => Math.max(Math.hypot(x - other[0], y - other[1]), 1);
      const ahead = PINCH_RADII * Math.log2(apart(event.clientX, event.clientY) / apart(...before));
      const step = look.multiplyScalar(ahead).addScaledVector(right, -PAN_RADII * dx).addScaledVector(up, PAN_RADII * dy);
      this.go(step.multiplyScalar(this.wall.radius));
    } else {
      // The wall follows the pointer.
      this.turn(-dx * TURN_RAD_PER_PX, dy * TURN_RAD_PER_PX);
    }
  }
}

function clickPx(event: PointerEvent): number {
  return event.pointerType === "mouse" ? CLICK_PX.mouse : CLICK_PX.touch;
}
