/**
 * Map of the unrolled wall around the camera, chainage to the right and θ up, above a bar of the
 * whole length.
 */
import type { Layer } from "./tunnel";
import type { Wall, WallPlace } from "./wall";

/** Minimum distance of chainage labels in the map, pixels. */
const MIN_TICK_PX = 60;
/** Minimum distance of a clock label from an edge, pixels. */
const MIN_CLOCK_PX = 10;
/** Width of the clock labels, pixels. */
const CLOCK_ROOM_PX = 40;

export interface Pin {
  place: WallPlace;
  colour: string;
}

export class WallMap {
  onJump: (place: WallPlace) => void = () => {};
  private layer: Layer | null = null;
  private pictures = new Map<number, HTMLImageElement>();
  private eye: WallPlace = { s: 0, h: 0 };
  private seen: WallPlace | null = null;
  private pins: Pin[] = [];

  constructor(
    private readonly canvas: HTMLCanvasElement,
    private readonly whole: HTMLCanvasElement,
    private readonly wall: Wall,
  ) {
    canvas.addEventListener("click", (event) => this.onJump(this.placeAt(event.offsetX, event.offsetY)));
    whole.addEventListener("click", (event) => {
      const [from, to] = wall.chainage;
      this.onJump({ s: this.seen?.s ?? 0, h: from + ((to - from) * event.offsetX) / whole.clientWidth });
    });
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  show(layer: Layer): void {
    this.layer = layer;
    this.pictures.clear();
    this.draw();
  }

  /** Updates the camera's chainage `h`, the viewed wall position `seen` and the pins. */
  move(h: number, seen: WallPlace | null, pins: Pin[]): void {
    this.eye = { s: 0, h };
    [this.seen, this.pins] = [seen, pins];
    this.draw();
  }

  /** Scale of the map, screen pixels per metre. */
  private get scale(): number {
    return this.canvas.clientHeight / this.wall.perimeter;
  }

  /** Chainage at the left edge; the camera is in the centre except at the ends of the tunnel. */
  private get left(): number {
    const [from, to] = this.wall.chainage;
    const span = this.canvas.clientWidth / this.scale;
    if (span >= to - from) return from - (span - (to - from)) / 2;
    return Math.min(Math.max(this.eye.h - span / 2, from), to - span);
  }

  private placeAt(x: number, y: number): WallPlace {
    const [from, to] = this.wall.chainage;
    const h = Math.min(Math.max(this.left + x / this.scale, from), to);
    return { s: (1 - y / this.canvas.clientHeight) * this.wall.perimeter, h };
  }

  private draw(): void {
    const [context, width, height] = fit(this.canvas);
    if (!context) return;
    const [left, scale] = [this.left, this.scale];
    if (this.layer) this.drawPictures(context, this.layer, left, scale, height);
    const at = ({ s, h }: WallPlace): [number, number] => [(h - left) * scale, (1 - this.wall.around(s) / this.wall.perimeter) * height];
    this.drawScale(context, left, scale, width, height);
    this.drawClock(context, at({ s: 0, h: this.wall.chainage[0] })[0], height);
    context.fillStyle = "#ffb02e";
    const [x] = at(this.eye);
    context.fillRect(x - 1, 0, 2, height);
    for (const pin of this.pins) dot(context, at(pin.place), 4, pin.colour);
    if (this.seen) dot(context, at(this.seen), 5, "#ffb02e");
    this.drawWhole(width / scale, left);
  }

  private drawPictures(context: CanvasRenderingContext2D, layer: Layer, left: number, scale: number, height: number): void {
    const { map, chainage_m } = layer;
    const span = map.rows_px / map.px_per_metre;
    const count = Math.ceil(map.size_px[1] / map.rows_px);
    const first = Math.max(Math.floor((left - chainage_m[0]) / span), 0);
    const last = Math.min(Math.floor((left + this.canvas.clientWidth / scale - chainage_m[0]) / span), count - 1);
    for (let row = first; row <= last; row++) {
      const picture = this.picture(map.folder, row);
      if (!picture.complete || picture.naturalWidth === 0) continue;
      const rows = picture.naturalHeight - 2 * map.border_px;
      const columns = picture.naturalWidth - 2 * map.border_px;
      context.save();
      // Rotated counter-clockwise: columns point up, rows to the right.
      const start = (chainage_m[0] + row * span - left) * scale;
      const [along, across] = [scale / map.px_per_metre, height / map.size_px[0]];
      context.transform(0, -across, along, 0, start, height);
      context.drawImage(picture, map.border_px, map.border_px, columns, rows, 0, 0, columns, rows);
      context.restore();
    }
  }

  /** Draws chainage labels along the lower edge. */
  private drawScale(context: CanvasRenderingContext2D, left: number, scale: number, width: number, height: number): void {
    const [from, to] = this.wall.chainage;
    const metres = [1, 2, 5, 10, 20, 50, 100].find((step) => step * scale >= MIN_TICK_PX) ?? 200;
    context.font = "11px system-ui, sans-serif";
    context.textBaseline = "bottom";
    for (let h = Math.ceil(Math.max(left, from) / metres) * metres; h <= Math.min(to, left + width / scale); h += metres) {
      const x = (h - left) * scale;
      context.fillStyle = "#fffa";
      context.fillRect(x, height - 6, 1, 6);
      context.strokeStyle = "#000";
      context.lineWidth = 3;
      context.strokeText(`${h} m`, x + 3, height);
      context.fillText(`${h} m`, x + 3, height);
    }
  }

  /** Draws clock labels beside the wall, or on it if it fills the map. */
  private drawClock(context: CanvasRenderingContext2D, left: number, height: number): void {
    const beside = left > CLOCK_ROOM_PX;
    const x = beside ? left - 4 : Math.max(left, 0) + 4;
    context.textBaseline = "middle";
    context.textAlign = beside ? "end" : "start";
    context.strokeStyle = "#000";
    context.fillStyle = "#fffa";
    context.lineWidth = 3;
    for (const hour of [12, 3, 6, 9]) {
      const y = (1 - this.wall.sAtHour(hour) / this.wall.perimeter) * height;
      // The cut of the section is at both edges.
      if (y < MIN_CLOCK_PX || y > height - MIN_CLOCK_PX) continue;
      context.strokeText(`${hour}:00`, x, y);
      context.fillText(`${hour}:00`, x, y);
    }
    context.textAlign = "start";
  }

  private picture(folder: string, row: number): HTMLImageElement {
    const known = this.pictures.get(row);
    if (known) return known;
    const picture = new Image();
    picture.addEventListener("load", () => this.draw());
    picture.src = `${folder}/${row}.jpg`;
    this.pictures.set(row, picture);
    return picture;
  }

  private drawWhole(span: number, left: number): void {
    const [context, width, height] = fit(this.whole);
    if (!context) return;
    const [from, to] = this.wall.chainage;
    const at = (h: number) => ((h - from) / (to - from)) * width;
    context.fillStyle = "#333a42";
    context.fillRect(0, 0, width, height);
    context.fillStyle = "#6b7683";
    const begin = Math.max(at(left), 0);
    context.fillRect(begin, 0, Math.max(Math.min(at(left + span), width) - begin, 2), height);
    context.fillStyle = "#ffb02e";
    context.fillRect(at(this.eye.h) - 1, 0, 3, height);
    for (const pin of this.pins) {
      context.fillStyle = pin.colour;
      context.fillRect(at(pin.place.h) - 1, 0, 2, height);
    }
  }
}

function dot(context: CanvasRenderingContext2D, [x, y]: [number, number], radius: number, colour: string): void {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.strokeStyle = colour;
  context.lineWidth = 2;
  context.stroke();
}

/** Resizes a canvas to its displayed size and clears it; coordinates are CSS pixels. */
function fit(canvas: HTMLCanvasElement): [CanvasRenderingContext2D | null, number, number] {
  const [width, height, ratio] = [canvas.clientWidth, canvas.clientHeight, window.devicePixelRatio];
  const [columns, rows] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== columns || canvas.height !== rows) [canvas.width, canvas.height] = [columns, rows];
  const context = canvas.getContext("2d");
  context?.setTransform(ratio, 0, 0, ratio, 0, 0);
  context?.clearRect(0, 0, width, height);
  return [context, width, height];
}
