/** The wall as tiles of one layer at a time, and the place of the wall under a pixel. */
import { TilesRenderer } from "3d-tiles-renderer";
import { Group, Mesh, MeshBasicMaterial, Object3D, PerspectiveCamera, Raycaster, Texture, Vector2, WebGLRenderer } from "three";
import type { Layer, Tunnel } from "./tunnel";
import type { WallPlace } from "./wall";

/** Memory for tiles, bytes: what is not in sight goes first when there is more. */
const MOST_BYTES = 256 * 2 ** 20;
const KEPT_BYTES = 160 * 2 ** 20;
const MIB = 2 ** 20;
/** Updates without anything to wait for, until all is there. */
const SETTLED = 3;

export class Layers {
  readonly group = new Group();
  /** Called when there is something new to draw. */
  onChange: () => void = () => {};
  onProblem: (what: string) => void = () => {};
  private shown: TilesRenderer | null = null;
  private layer: Layer;
  private next: TilesRenderer | null = null;
  /** Layers that wait for tiles, and updates since none did. */
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

  /** Shows a layer as soon as enough of it is there; until then the one before. */
  show(name: string): void {
    this.layer = this.tunnel.layers.find((layer) => layer.name === name) ?? this.tunnel.layers[0];
    if (this.next) this.drop(this.next);
    const tiles = new TilesRenderer(this.layer.tileset);
    tiles.lruCache.maxBytesSize = MOST_BYTES;
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

  /** Loads what is in sight. */
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

  /** Whether all that is in sight is there. */
  get complete(): boolean {
    // What has just come may ask for more.
    return this.idle >= SETTLED;
  }

  private drop(tiles: TilesRenderer): void {
    tiles.group.removeFromParent();
    this.busy.delete(tiles);
    tiles.dispose();
  }

  /** The place of the wall under a point of the view (−1 to 1, up). */
  pick(x: number, y: number): WallPlace | null {
    if (!this.shown) return null;
    this.ray.setFromCamera(new Vector2(x, y), this.camera);
    const hit = this.ray.intersectObject(this.shown.group, true)[0];
    // Where the tile's picture lies on the wall is written in its mesh.
    const place = hit?.object.userData.wall as { corner_m: [number, number]; extent_m: [number, number] } | undefined;
    if (!place || !hit.uv) return null;
    return { s: place.corner_m[0] + hit.uv.x * place.extent_m[0], h: place.corner_m[1] + hit.uv.y * place.extent_m[1] };
  }

  /** Memory of all textures that are held, MiB: four bytes a pixel, and a third for overviews. */
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
