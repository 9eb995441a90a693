/** Values that a layer shows besides its picture: the deformation of the wall. */
import { byId } from "./element";
import { read, type Layer, type LayerValues, type Tunnel } from "./tunnel";
import type { WallPlace } from "./wall";

/** Content of the file of values: rows of cells along the axis, each beginning at θ = 0. */
interface Grid {
  around: number;
  along: number;
  chainage_m: [number, number];
  deviation_mm: (number | null)[];
  sigma_mm: (number | null)[];
}

export class Values {
  private readonly root = byId<HTMLElement>("values");
  private grid: Grid | null = null;
  private layer: LayerValues | null = null;

  constructor(private readonly tunnel: Tunnel) {}

  /** Shows the scale of a layer and loads its values, or hides the scale if it has none. */
  async show(layer: Layer): Promise<void> {
    this.layer = layer.values ?? null;
    this.root.hidden = this.layer === null;
    if (!this.layer) return;
    const [low, high] = this.layer.range_mm;
    byId("values-low").textContent = `${low.toFixed(1)} mm`;
    byId("values-high").textContent = `+${high.toFixed(1)} mm`;
    byId<HTMLElement>("values-bar").style.background = this.layer.gradient;
    this.grid ??= await read<Grid>(this.layer.file);
  }

  /** Shows the value at a wall position. */
  point(place: WallPlace | null): void {
    if (this.layer) byId("value").textContent = (place && this.text(place)) ?? "not determined";
  }

  private text(place: WallPlace): string | null {
    const grid = this.grid;
    if (!grid) return null;
    const [from, to] = grid.chainage_m;
    const row = Math.floor(((place.h - from) / (to - from)) * grid.along);
    const turn = place.s / this.tunnel.perimeter_m;
    const column = Math.floor((turn - Math.floor(turn)) * grid.around) % grid.around;
    if (row < 0 || row >= grid.along) return null;
    const value = grid.deviation_mm[row * grid.around + column];
    if (value === null) return null;
    const sigma = grid.sigma_mm[row * grid.around + column];
    const sign = value < 0 ? "−" : "+";
    const stated = sigma === null ? "" : ` ± ${sigma.toFixed(2)}`;
    return `${sign}${Math.abs(value).toFixed(2)}${stated} mm`;
  }
}
