/** Tiles of the shown layer, and the wall position under a pixel. */
import { TilesRenderer } from "3d-tiles-renderer";
import { Group, Mesh, MeshBasicMaterial, Object3D, PerspectiveCamera, Raycaster, Texture, Vector2, WebGLRenderer } from "three";
import type { Layer, Tunnel } from "./tunnel";
import type { WallPlace } from "./wall";

/** Maximum memory for tiles, bytes; invisible tiles are evicted first. */
const MAX_BYTES = 256 * 2 ** 20;
const KEPT_BYTES = 160 * 2 ** 20;
const MIB = 2 ** 20;
/** Number of idle updates after which loading is complete. */
const IDLE_UPDATES = 3;

export class Layers {
  readonly group = new Group();
  /** Called when the view must be redrawn. */
  onChange: () => void = () => {};
  onProblem: (what: string) => void = () => {};
  private shown: TilesRenderer | null = null;
  private layer: Layer;
  private next: TilesRenderer | null = null;
  /** Tilesets that are loading, and number of updates since the last one finished. */
  private readonly busy = new Set<TilesRenderer>();
  private idle = 0;
  private readonly ray = new Raycaster();

  constructor(
    private readonly tunnel: Tunnel,
    private readonly camera: PerspectiveCamera,
    private readonly renderer: WebGLRenderer,
  ) {
    this.layer = tunnel.layers[0];
  }

  get current(): Layer {
    return this.layer;
  }

  /** Shows a layer as soon as enough of it is loaded; until then the previous one stays. */
  show(name: string): void {
    this.layer = this.tunnel.layers.find((layer) => layer.name === name) ?? this.tunnel.layers[0];
    if (this.next) this.drop(this.next);
    const tiles = new TilesRenderer(this.layer.tileset);
    tiles.lruCache.maxBytesSize = MAX_BYTES;
    tiles.lruCache.minBytesSize = KEPT_BYTES;
    tiles.setCamera(this.camera);
    tiles.setResolutionFromRenderer(this.camera, this.renderer);
    const anisotropy = this.renderer.capabilities.getMaxAnisotropy();
    tiles.addEventListener("load-model", ({ scene }) => {
      scene.traverse((object: Object3D) => {
        const texture = textureOf(object);
        if (texture) texture.anisotropy = anisotropy;
      });
      this.onChange();
    });
    tiles.addEventListener("load-error", ({ url, error }) => this.onProblem(`${url}: ${error.message}`));
    for (const event of ["needs-update", "tile-visibility-change", "load-root-tileset", "tiles-load-end"]) {
      tiles.addEventListener(event, () => this.onChange());
    }
    tiles.addEventListener("tiles-load-start", () => this.busy.add(tiles));
    tiles.addEventListener("tiles-load-end", () => this.busy.delete(tiles));
    this.next = tiles;
    this.idle = 0;
    this.onChange();
  }

  /** Loads the visible tiles. */
  update(): void {
    this.camera.updateMatrixWorld();
    for (const tiles of [this.next, this.shown]) {
      tiles?.setResolutionFromRenderer(this.camera, this.renderer);
      tiles?.update();
    }
    const waiting = this.busy.size > 0 || (this.next !== null && !this.next.root);
    this.idle = waiting ? 0 : this.idle + 1;
    if (this.next && this.complete) {
      if (this.shown) this.drop(this.shown);
      this.shown = this.next;
      this.next = null;
      this.group.add(this.shown.group);
      this.onChange();
    }
  }

  /** True if all visible tiles are loaded. */
  get complete(): boolean {
    // Loaded tiles may request others.
    return this.idle >= IDLE_UPDATES;
  }

  private drop(tiles: TilesRenderer): void {
    tiles.group.removeFromParent();
    this.busy.delete(tiles);
    tiles.dispose();
  }

  /** Wall position under a point of the view (normalised device coordinates, −1 to 1, y up). */
  pick(x: number, y: number): WallPlace | null {
    if (!this.shown) return null;
    this.ray.setFromCamera(new Vector2(x, y), this.camera);
    const hit = this.ray.intersectObject(this.shown.group, true)[0];
    // The mesh stores the extent of its texture on the wall.
    const place = hit?.object.userData.wall as { corner_m: [number, number]; extent_m: [number, number] } | undefined;
    if (!place || !hit.uv) return null;
    return { s: place.corner_m[0] + hit.uv.x * place.extent_m[0], h: place.corner_m[1] + hit.uv.y * place.extent_m[1] };
  }

  /** Memory of all loaded textures, MiB: four bytes per pixel, and a third for mipmaps. */
  textureMiB(): number {
    let bytes = 0;
    for (const tiles of [this.shown, this.next]) {
      tiles?.forEachLoadedModel((scene) => {
        scene.traverse((object) => {
          const image = textureOf(object)?.image as { width: number; height: number } | undefined;
          if (image) bytes += (image.width * image.height * 4 * 4) / 3;
        });
      });
    }
    return bytes / MIB;
  }
}

function textureOf(object: Object3D): Texture | null {
  return object instanceof Mesh && object.material instanceof MeshBasicMaterial ? object.material.map : null;
}
