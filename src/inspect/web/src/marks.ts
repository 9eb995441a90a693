/** Marks: GeoJSON features on the unrolled wall, stored by the server or else by this browser. */
import { clockOf } from "./clock";
import type { Tunnel } from "./tunnel";
import type { Wall, WallPlace } from "./wall";

export interface Mark {
  type: "Feature";
  id: string;
  geometry: { type: "Point"; coordinates: [number, number] } | { type: "LineString"; coordinates: [[number, number], [number, number]] };
  properties: {
    class: string;
    severity: number;
    note: string;
    chainage_m: number;
    clock: string;
    theta_deg: number;
    x_m: number;
    y_m: number;
    z_m: number;
    end_chainage_m?: number;
    end_clock?: string;
    length_m?: number;
    width_mm?: number;
    layer: string;
    created: string;
  };
}

/** Measurement of a mark. */
export type Measure = { kind: "point" } | { kind: "length"; length_m: number } | { kind: "width"; width_mm: number };

/** Inspector's description of a defect. */
export interface Remark {
  class: string;
  severity: number;
  note: string;
}

/** Wall positions of a mark, one or two. */
export function placesOf(mark: Mark): WallPlace[] {
  const { geometry } = mark;
  const all = geometry.type === "Point" ? [geometry.coordinates] : geometry.coordinates;
  return all.map(([h, s]) => ({ s, h }));
}

/** The mark with chainage before arc length; marks of version 0.1 have arc length first, which their chainages tell. */
function chainageFirst(mark: Mark): Mark {
  const { geometry, properties } = mark;
  const all = geometry.type === "Point" ? [geometry.coordinates] : geometry.coordinates;
  const chainages = [properties.chainage_m, properties.end_chainage_m];
  const isAt = (axis: 0 | 1) =>
    all.every((place, k) => {
      const chainage = chainages[k];
      return chainage === undefined || Math.abs(place[axis] - chainage) <= 1e-6;
    });
  if (isAt(0) || !isAt(1)) return mark;
  const turned = ([s, h]: [number, number]): [number, number] => [h, s];
  return {
    ...mark,
    geometry:
      geometry.type === "Point"
        ? { type: "Point", coordinates: turned(geometry.coordinates) }
        : { type: "LineString", coordinates: [turned(geometry.coordinates[0]), turned(geometry.coordinates[1])] },
  };
}

export function newMark(tunnel: Tunnel, wall: Wall, layer: string, places: WallPlace[], measure: Measure, remark: Remark): Mark {
  const [first, second] = places;
  const x = wall.point(first);
  const clock = (place: WallPlace) => clockOf(wall.thetaDeg(place.s), tunnel.twelve_at_deg);
  const end = second && wall.nearest(first, second);
  return {
    type: "Feature",
    id: newId(),
    geometry: end
      ? { type: "LineString", coordinates: [[first.h, first.s], [end.h, end.s]] }
      : { type: "Point", coordinates: [first.h, first.s] },
    properties: {
      ...remark,
      chainage_m: first.h,
      clock: clock(first),
      theta_deg: wall.thetaDeg(first.s),
      x_m: x.x,
      y_m: x.y,
      z_m: x.z,
      ...(end && { end_chainage_m: end.h, end_clock: clock(end) }),
      ...(measure.kind === "length" && { length_m: measure.length_m }),
      ...(measure.kind === "width" && { width_mm: measure.width_mm }),
      layer,
      created: new Date().toISOString(),
    },
  };
}

/** Creates a unique identifier (`randomUUID` is unavailable on pages without TLS). */
function newId(): string {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (byte) => byte.toString(16).padStart(2, "0")).join("");
}

/** Storage of marks. */
export interface Store {
  all(): Promise<Mark[]>;
  put(mark: Mark): Promise<void>;
  remove(id: string): Promise<void>;
}

interface Collection {
  type: "FeatureCollection";
  features: Mark[];
}

export class ServerStore implements Store {
  async all(): Promise<Mark[]> {
    const answer = await fetch("api/marks");
    if (!answer.ok) throw new Error(await answer.text());
    return ((await answer.json()) as Collection).features;
  }

  put(mark: Mark): Promise<void> {
    return this.change("PUT", mark.id, JSON.stringify(mark));
  }

  remove(id: string): Promise<void> {
    return this.change("DELETE", id, undefined);
  }

  private async change(method: string, id: string, body: string | undefined): Promise<void> {
    const answer = await fetch(`api/marks/${id}`, { method, body, headers: { "Content-Type": "application/json" } });
    if (!answer.ok) throw new Error(await answer.text());
  }
}

/** Storage in this browser, keyed by the page's address. */
export class LocalStore implements Store {
  private readonly key = `marks ${location.pathname}`;

  async all(): Promise<Mark[]> {
    return (JSON.parse(localStorage.getItem(this.key) ?? "[]") as Mark[]).map(chainageFirst);
  }

  async put(mark: Mark): Promise<void> {
    const others = (await this.all()).filter((other) => other.id !== mark.id);
    localStorage.setItem(this.key, JSON.stringify([...others, mark]));
  }

  async remove(id: string): Promise<void> {
    localStorage.setItem(this.key, JSON.stringify((await this.all()).filter((mark) => mark.id !== id)));
  }
}

/** Encodes marks as GeoJSON, as the server does. */
export function geojson(marks: Mark[]): string {
  const collection: Collection = { type: "FeatureCollection", features: marks };
  return JSON.stringify(collection, null, 2) + "\n";
}

/** Encodes marks as CSV in order of chainage, quoted by RFC 4180, as the server does. */
export function csv(marks: Mark[]): string {
  const number = (value: number | undefined, digits: number) => value?.toFixed(digits) ?? "";
  // A spreadsheet would run a text that begins like a formula.
  const inert = (text: string) => (/^'*[=+\-@\t\r]/.test(text) ? `'${text}` : text);
  const columns: [string, (id: string, p: Mark["properties"]) => string][] = [
    ["id", (id) => inert(id)],
    ["class", (_, p) => inert(p.class)],
    ["severity", (_, p) => String(p.severity)],
    ["chainage_m", (_, p) => number(p.chainage_m, 4)],
    ["clock", (_, p) => inert(p.clock)],
    ["theta_deg", (_, p) => number(p.theta_deg, 3)],
    ["end_chainage_m", (_, p) => number(p.end_chainage_m, 4)],
    ["end_clock", (_, p) => inert(p.end_clock ?? "")],
    ["length_m", (_, p) => number(p.length_m, 4)],
    ["width_mm", (_, p) => number(p.width_mm, 2)],
    ["x_m", (_, p) => number(p.x_m, 4)],
    ["y_m", (_, p) => number(p.y_m, 4)],
    ["z_m", (_, p) => number(p.z_m, 4)],
    ["note", (_, p) => inert(p.note)],
    ["layer", (_, p) => inert(p.layer)],
    ["created", (_, p) => inert(p.created)],
  ];
  const quoted = (text: string) => (/[",\r\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
  const sorted = [...marks].sort((a, b) => a.properties.chainage_m - b.properties.chainage_m);
  const rows = sorted.map((mark) => columns.map(([, value]) => quoted(value(mark.id, mark.properties))));
  return [columns.map(([name]) => name), ...rows].map((row) => row.join(",") + "\n").join("");
}

export function download(name: string, type: string, text: string): void {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
