/** Main program of the page. */
import { Group, PerspectiveCamera, Scene, SRGBColorSpace, WebGLRenderer } from "three";
import { camerasOf, disposeCameras } from "./cameras";
import { clockOf, placeOf, thetaOf } from "./clock";
import { byId, make, press } from "./element";
import { Layers } from "./layers";
import { WallMap } from "./map";
import { LocalStore, type Mark, type Measure, ServerStore, type Store, csv, download, geojson, newMark, placesOf } from "./marks";
import { wirePad } from "./pad";
import { Overlay, type Shape } from "./overlay";
import { Panel, valueOf } from "./panel";
import { type Capabilities, type Tunnel, type WallPoints, read } from "./tunnel";
import { Values } from "./values";
import { Walk } from "./walk";
import { Wall, type WallPlace } from "./wall";

const FIELD_OF_VIEW_DEG = 75;
/** Interval of updates of the address and the statistics, milliseconds. */
const STATUS_INTERVAL_MS = 400;
const TOOLS = ["look", "mark", "length", "width", "frames"] as const;
type Tool = (typeof TOOLS)[number];

class Page {
  private readonly view = byId<HTMLCanvasElement>("view");
  private readonly camera = new PerspectiveCamera(FIELD_OF_VIEW_DEG, 1);
  private readonly scene = new Scene();
  private readonly renderer = new WebGLRenderer({ canvas: this.view, antialias: true, powerPreference: "high-performance" });
  private readonly panel = new Panel();
  private readonly wall: Wall;
  private readonly walk: Walk;
  private readonly layers: Layers;
  private readonly map: WallMap;
  private readonly overlay: Overlay;
  private readonly store: Store;
  private readonly values: Values;
  /** Pointer in the view, normalised device coordinates. */
  private pointer: [number, number] = [0, 0];
  private cameras: Group | null = null;
  private marks: Mark[] = [];
  private chosen = "";
  private tool: Tool = "look";
  private begun: WallPlace | null = null;
  private measured: Shape | null = null;
  private dirty = true;
  private before = performance.now();
  private lastSlow = 0;

  constructor(
    private readonly tunnel: Tunnel,
    points: WallPoints,
    private readonly capabilities: Capabilities,
  ) {
    this.wall = new Wall(tunnel, points);
    this.walk = new Walk(this.wall, this.camera, this.view);
    this.layers = new Layers(tunnel, this.camera, this.renderer);
    this.map = new WallMap(byId("map"), byId("whole"), this.wall);
    this.overlay = new Overlay(byId("overlay"), this.wall, this.camera);
    this.values = new Values(tunnel);
    this.store = capabilities.marks ? new ServerStore() : new LocalStore();
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.scene.add(this.layers.group);
    document.title = `${tunnel.name}: tunnel`;
    byId("name").textContent = tunnel.name;
    this.wire();
  }

  async start(): Promise<void> {
    this.resize();
    this.showLayer(this.tunnel.layers[0].name);
    this.goTo(location.hash);
    this.before = performance.now();
    requestAnimationFrame((now) => this.frame(now));
    this.marks = await this.store.all();
    this.listMarks();
  }

  private wire(): void {
    new ResizeObserver(() => this.resize()).observe(this.view);
    this.layers.onChange = () => (this.dirty = true);
    this.layers.onProblem = (what) => this.panel.problem(what);
    this.walk.onClick = (x, y) => this.click(x, y);
    this.map.onJump = (place) => this.jump(place);
    this.view.addEventListener("pointermove", (event) => {
      this.pointer = document.pointerLockElement ? [0, 0] : this.deviceOf(event.offsetX, event.offsetY);
      this.showValue();
    });
    window.addEventListener("hashchange", () => this.goTo(location.hash));
    window.addEventListener("keydown", (event) => this.key(event));
    for (const button of document.querySelectorAll<HTMLButtonElement>("[data-tool]")) {
      button.addEventListener("click", () => this.choose(button.dataset.tool as Tool));
      if (button.dataset.tool === "frames") button.hidden = !this.capabilities.frames;
    }
    byId("ride").addEventListener("click", () => this.ride());
    wirePad(byId("pad"), this.walk);
    byId("lock").addEventListener("click", () => this.lock());
    byId("cameras").addEventListener("click", () => this.toggleCameras());
    byId("help").addEventListener("click", () => byId<HTMLDialogElement>("keys").showModal());
    const light = () => {
      const share = (id: string) => byId<HTMLInputElement>(id).value;
      this.view.style.filter = `brightness(${share("brightness")}) contrast(${share("contrast")})`;
    };
    for (const id of ["brightness", "contrast"]) byId(id).addEventListener("input", light);
    for (const layer of this.tunnel.layers) {
      const button = make("button", { type: "button" }, layer.name);
      button.dataset.layer = layer.name;
      button.addEventListener("click", () => this.showLayer(layer.name));
      byId("layers").append(button);
    }
  }

  private frame(now: number): void {
    requestAnimationFrame((next) => this.frame(next));
    const seconds = Math.min((now - this.before) / 1000, 0.1);
    this.before = now;
    const moved = this.walk.update(seconds);
    press(byId("ride"), this.walk.riding);
    if (moved || this.dirty || !this.layers.complete) {
      this.dirty = false;
      this.layers.update();
      this.renderer.render(this.scene, this.camera);
      this.drawShapes();
    }
    const loading = this.layers.complete ? "0" : "1";
    // Immediately when loading is complete, else at intervals.
    const arrived = loading === "0" && document.body.dataset.loading === "1";
    if (arrived || now - this.lastSlow > STATUS_INTERVAL_MS) {
      this.lastSlow = now;
      this.updateStatus();
    }
    document.body.dataset.loading = loading;
  }

  /** Updates position, map, statistics and address. */
  private updateStatus(): void {
    const { h } = this.walk.station;
    const seen = this.layers.pick(0, 0);
    const at = seen ? `; looking at ${this.where(seen)}` : "";
    byId("place").textContent = `at ${h.toFixed(2)} m, ${this.walk.clearance.toFixed(2)} m from the wall${at}`;
    this.showValue();
    const pins = this.marks.map((mark) => ({ place: placesOf(mark)[0], colour: "#ff5d5d" }));
    this.map.move(h, seen, pins);
    const { triangles } = this.renderer.info.render;
    const speed = `${this.walk.speed.toFixed(2)} m/s`;
    byId("statistics").textContent = `${triangles} triangles, ${this.layers.textureMiB().toFixed(1)} MiB of textures, ${speed}`;
    if (seen && document.activeElement?.closest("form") == null) {
      const hash = `#h=${seen.h.toFixed(2)}&clock=${this.clock(seen)}`;
      if (hash !== location.hash) history.replaceState(null, "", hash);
    }
  }

  /** Normalised device coordinates of a point of the view, CSS pixels. */
  private deviceOf(x: number, y: number): [number, number] {
    return [(x / this.view.clientWidth) * 2 - 1, 1 - (y / this.view.clientHeight) * 2];
  }

  /** Shows the value of the layer under the pointer, if it has values. */
  private showValue(): void {
    if (this.layers.current.values) this.values.point(this.layers.pick(...this.pointer));
  }

  private clock(place: WallPlace): string {
    return clockOf(this.wall.thetaDeg(place.s), this.tunnel.twelve_at_deg);
  }

  private where(place: WallPlace): string {
    return `${place.h.toFixed(3)} m, ${this.clock(place)} o'clock`;
  }

  /** Goes to the position in the address. */
  private goTo(hash: string): void {
    const place = placeOf(hash);
    const theta = place && thetaOf(place.clock, this.tunnel.twelve_at_deg);
    if (place && theta !== null) this.jump({ s: this.wall.sAt(theta), h: place.h });
  }

  private jump(place: WallPlace): void {
    this.walk.riding = false;
    this.walk.lookAt(place);
  }

  private resize(): void {
    const [width, height] = [this.view.clientWidth, this.view.clientHeight];
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(height, 1);
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  private showLayer(name: string): void {
    this.layers.show(name);
    this.map.show(this.layers.current);
    this.values.show(this.layers.current).catch((error: Error) => this.panel.problem(error.message));
    for (const button of document.querySelectorAll<HTMLElement>("[data-layer]")) press(button, button.dataset.layer === name);
    if (this.cameras) {
      this.toggleCameras();
      this.toggleCameras();
    }
  }

  private toggleCameras(): void {
    if (this.cameras) {
      disposeCameras(this.cameras);
      this.cameras = null;
    } else {
      this.cameras = camerasOf(this.tunnel, this.layers.current, this.wall.radius);
      this.scene.add(this.cameras);
    }
    press(byId("cameras"), this.cameras !== null);
    this.dirty = true;
  }

  private ride(): void {
    this.walk.riding = !this.walk.riding;
    if (this.walk.riding) this.walk.lookAlong();
  }

  private lock(): void {
    // Browsers without a pointer refuse; dragging works there.
    void Promise.resolve(this.view.requestPointerLock()).catch(() => {});
  }

  private key(event: KeyboardEvent): void {
    const typing = event.target instanceof HTMLElement && event.target.closest("input, textarea, select, dialog");
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const tool = TOOLS[Number(event.key) - 1];
    if (tool) this.choose(tool);
    else if (event.code === "KeyM") this.lock();
    else if (event.code === "KeyC") this.toggleCameras();
    else if (event.code === "Escape") this.choose("look");
    else if (event.code === "Space") {
      event.preventDefault();
      this.ride();
    }
  }

  private choose(tool: Tool): void {
    if (tool === "frames" && !this.capabilities.frames) return;
    this.tool = tool;
    [this.begun, this.measured] = [null, null];
    document.body.dataset.tool = tool;
    for (const button of document.querySelectorAll<HTMLElement>("[data-tool]:is(button)")) press(button, button.dataset.tool === tool);
    this.panel.close();
    if (tool === "length" || tool === "width") this.panel.say(tool === "length" ? "Length along the wall" : "Width of a crack", "Click one end, then the other.");
    this.dirty = true;
  }

  private click(x: number, y: number): void {
    if (this.tool === "look") return;
    const place = this.layers.pick(...this.deviceOf(x, y));
    if (!place) return this.panel.say("Nothing there", "No wall was hit.");
    if (this.tool === "frames") {
      this.measured = { places: [place], label: "", chosen: true };
      const { name } = this.layers.current;
      this.panel.frames(this.where(place), name, place, this.tunnel.frames).catch((error: Error) => this.panel.problem(error.message));
    } else if (this.tool === "mark") {
      this.finish([place], { kind: "point" });
    } else if (!this.begun) {
      this.begun = place;
      this.measured = { places: [place], label: "", chosen: true };
    } else {
      const end = this.wall.nearest(this.begun, place);
      const metres = this.wall.length(this.begun, end);
      const measure: Measure = this.tool === "length" ? { kind: "length", length_m: metres } : { kind: "width", width_mm: metres * 1000 };
      this.finish([this.begun, end], measure);
      this.begun = null;
    }
    this.dirty = true;
  }

  /** Shows the measurement and the form to save it as a mark. */
  private finish(places: WallPlace[], measure: Measure): void {
    this.measured = { places, label: valueOf(measure), chosen: true };
    const titles = { point: "Mark a defect", length: "Length along the wall", width: "Width of a crack" };
    this.panel.form(titles[measure.kind], this.where(places[0]), measure, async (remark) => {
      const mark = newMark(this.tunnel, this.wall, this.layers.current.name, places, measure, remark);
      await this.store.put(mark);
      this.marks.push(mark);
      [this.measured, this.chosen] = [null, mark.id];
      this.listMarks();
    });
  }

  private drawShapes(): void {
    const label = (mark: Mark) => {
      const { class: code, length_m, width_mm } = mark.properties;
      if (length_m !== undefined) return `${code} ${valueOf({ kind: "length", length_m })}`;
      return width_mm === undefined ? code : `${code} ${valueOf({ kind: "width", width_mm })}`;
    };
    const shapes = this.marks.map((mark) => ({ places: placesOf(mark), label: label(mark), chosen: mark.id === this.chosen }));
    this.overlay.draw(this.measured ? [...shapes, this.measured] : shapes);
  }

  private listMarks(): void {
    const rows = [...this.marks]
      .sort((a, b) => a.properties.chainage_m - b.properties.chainage_m)
      .map((mark) => {
        const { class: code, severity, note, chainage_m, clock } = mark.properties;
        const go = make("button", { type: "button", title: note }, `${chainage_m.toFixed(2)} m ${clock} ${code} (${severity})`);
        go.addEventListener("click", () => {
          this.chosen = mark.id;
          this.jump(placesOf(mark)[0]);
        });
        const remove = make("button", { type: "button", title: "Remove" }, "×");
        remove.addEventListener("click", () => void this.remove(mark));
        return make("li", {}, go, remove);
      });
    const root = byId("marks");
    root.replaceChildren();
    this.dirty = true;
    if (rows.length === 0) return;
    const row = make("div", { className: "row" }, make("strong", {}, rows.length === 1 ? "1 mark" : `${rows.length} marks`));
    if (!this.capabilities.marks) {
      const save = (name: string, file: string, type: string, text: (marks: Mark[]) => string) => {
        const button = make("button", { type: "button", title: `Save as ${file}` }, name);
        button.addEventListener("click", () => download(file, type, text(this.marks)));
        row.append(button);
      };
      save("GeoJSON", "marks.geojson", "application/geo+json", geojson);
      save("CSV", "marks.csv", "text/csv", csv);
    }
    root.append(row, make("ul", {}, ...rows));
  }

  private async remove(mark: Mark): Promise<void> {
    if (!confirm(`Remove ${mark.properties.class} at ${mark.properties.chainage_m.toFixed(2)} m?`)) return;
    try {
      await this.store.remove(mark.id);
      this.marks = this.marks.filter((other) => other.id !== mark.id);
      this.listMarks();
    } catch (error) {
      this.panel.problem(String(error));
    }
  }
}

async function start(): Promise<void> {
  const [tunnel, points, capabilities] = await Promise.all([
    read<Tunnel>("tunnel.json"),
    read<WallPoints>("wall.json"),
    read<Capabilities>("server.json"),
  ]);
  await new Page(tunnel, points, capabilities).start();
}

start().catch((error: Error) => {
  byId("place").textContent = `The tunnel cannot be shown: ${error.message}`;
});
