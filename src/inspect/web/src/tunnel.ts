/** Types of `tunnel.json`, `wall.json` and `server.json`. */

export interface MapImages {
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
  map: MapImages;
  /** Camera-to-world poses: position (m) and quaternion x, y, z, w. */
  poses: [number, number, number, number, number, number, number][];
  /** Values that the layer shows besides the picture. */
  values?: LayerValues;
}

export interface LayerValues {
  file: string;
  range_mm: [number, number];
  /** The colours, as a CSS gradient. */
  gradient: string;
}

export interface Tunnel {
  name: string;
  perimeter_m: number;
  twelve_at_deg: number;
  /** Angles θ at equal steps of arc length from 0 to the perimeter, non-decreasing. */
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

/** Capabilities of the server besides static files. */
export interface Capabilities {
  marks: boolean;
  frames: boolean;
}

export async function read<T>(name: string): Promise<T> {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name}: ${answer.status} ${answer.statusText}`);
  return (await answer.json()) as T;
}
