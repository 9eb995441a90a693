/** What `tunnel.json`, `wall.json` and `server.json` hold. */

export interface MapPlace {
  folder: string;
  px_per_metre: number;
  size_px: [number, number];
  rows_px: number;
  border_px: number;
}

export interface Layer {
  name: string;
  tileset: string;
  px_per_metre: number;
  chainage_m: [number, number];
  map: MapPlace;
  /** Position (m) and quaternion, x y z w, camera-to-world. */
  poses: [number, number, number, number, number, number, number][];
}

export interface Tunnel {
  name: string;
  perimeter_m: number;
  twelve_at_deg: number;
  /** Angles θ at equal steps of arc length around the section, from 0 to the perimeter; never falling. */
  theta_deg: number[];
  chainage_m: [number, number];
  frames: string[];
  corners: [number, number, number][];
  layers: Layer[];
}

export interface WallPoints {
  s_m: number[];
  h_m: number[];
  points_m: number[];
}

/** What the server can do besides handing out files. */
export interface Abilities {
  marks: boolean;
  frames: boolean;
}

export async function read<T>(name: string): Promise<T> {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name}: ${answer.status} ${answer.statusText}`);
  return (await answer.json()) as T;
}
