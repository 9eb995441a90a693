/** Side panel: measurements, the form of a mark, and the frames that show a point. */
import { byId, make } from "./element";
import type { Measure, Remark } from "./marks";
import type { WallPlace } from "./wall";

/** Observation of a point in a frame, as sent by the server. */
interface Sighting {
  frame: number;
  pixel: [number, number];
  distance_m: number;
  px_per_metre: number;
  obliqueness_deg: number;
}

/** Maximum number of listed frames. */
const MAX_FRAMES = 12;
/** Side of the cut-out around the point, pixels of the frame. */
const CUT_PX = 240;

const CLASSES = ["BAB crack", "BAC break", "BAF surface damage", "BAG protruding connection", "BBA roots", "BBB deposits", "BBF infiltration"];

export class Panel {
  private readonly root = byId<HTMLElement>("panel");

  close(): void {
    this.root.hidden = true;
    this.root.replaceChildren();
  }

  say(title: string, ...lines: string[]): void {
    this.open(title, ...lines.map((line) => make("p", {}, line)));
  }

  problem(what: string): void {
    this.open("This did not work", make("p", { className: "problem" }, what));
  }

  /** Shows the form of a mark, which stays open if `save` fails. */
  form(title: string, where: string, measure: Measure, save: (remark: Remark) => Promise<void>): void {
    const classes = make("datalist", { id: "classes" }, ...CLASSES.map((text) => make("option", { value: text })));
    const code = make("input", { name: "class", required: true, maxLength: 100, autocomplete: "off" });
    code.setAttribute("list", "classes");
    const severity = make("select", { name: "severity" });
    ["1 slight", "2", "3", "4", "5 severe"].forEach((text, k) => severity.append(make("option", { value: String(k + 1) }, text)));
    severity.value = "3";
    const note = make("textarea", { name: "note", rows: 3, maxLength: 5000 });
    const problem = make("p", { className: "problem" });
    const form = make(
      "form", {},
      make("label", {}, "Class (a code of EN 13508-2, or any text)", code), classes,
      make("label", {}, "Severity", severity),
      make("label", {}, "Note", note),
      make("div", { className: "row" }, make("button", { type: "submit", id: "save" }, "Save")),
      problem,
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      const remark = { class: code.value.trim(), severity: Number(severity.value), note: note.value };
      save(remark).then(() => this.close(), (error: Error) => (problem.textContent = error.message));
    });
    const value = valueOf(measure);
    const measured = value ? [make("p", { className: "value", id: "measured" }, value)] : [];
    this.open(title, make("p", {}, where), ...measured, form);
    code.focus();
  }

  /** Shows the frames that observe a wall position, the sharpest first. */
  async frames(where: string, layer: string, place: WallPlace, names: string[]): Promise<void> {
    const answer = await fetch(`api/sightings?layer=${encodeURIComponent(layer)}&s=${place.s}&h=${place.h}`);
    if (!answer.ok) throw new Error(await answer.text());
    const found = ((await answer.json()) as Sighting[]).slice(0, MAX_FRAMES);
    if (found.length === 0) return this.say("Frames", where, "No frame shows this place.");
    const canvas = make("canvas", { width: CUT_PX, height: CUT_PX });
    const facts = make("p", { id: "sighting" });
    const link = make("a", { target: "_blank", rel: "noopener" }, "whole frame");
    link.style.color = "inherit";
    const choose = make("select", { id: "sightings" });
    choose.setAttribute("aria-label", "Frame");
    found.forEach((one, k) => choose.append(make("option", { value: String(k) }, names[one.frame] ?? String(one.frame))));
    const show = () => {
      const one = found[Number(choose.value)];
      const [u, v] = one.pixel;
      facts.textContent = `pixel ${u.toFixed(1)}, ${v.toFixed(1)}; ${(1000 / one.px_per_metre).toFixed(2)} mm a pixel, ${one.distance_m.toFixed(2)} m away, ${one.obliqueness_deg.toFixed(0)}° oblique`;
      link.href = `api/frames/${one.frame}`;
      cutOut(canvas, link.href, u, v);
    };
    choose.addEventListener("change", show);
    this.open("Frames that show it", make("p", {}, where), make("div", { className: "row" }, choose, link), facts, canvas);
    show();
  }

  private open(title: string, ...content: Node[]): void {
    const close = make("button", { type: "button", title: "Close" }, "×");
    close.addEventListener("click", () => this.close());
    this.root.replaceChildren(make("div", { className: "row" }, make("strong", {}, title), close), ...content);
    this.root.hidden = false;
  }
}

export function valueOf(measure: Measure): string {
  if (measure.kind === "length") return `${measure.length_m.toFixed(3)} m`;
  return measure.kind === "width" ? `${measure.width_mm.toFixed(1)} mm` : "";
}

/** Draws the cut-out of a frame around a pixel, with a ring around the point. */
function cutOut(canvas: HTMLCanvasElement, address: string, u: number, v: number): void {
  const picture = new Image();
  picture.addEventListener("load", () => {
    const context = canvas.getContext("2d");
    if (!context) return;
    context.clearRect(0, 0, CUT_PX, CUT_PX);
    // The centre of the first pixel is (0, 0).
    context.drawImage(picture, u + 0.5 - CUT_PX / 2, v + 0.5 - CUT_PX / 2, CUT_PX, CUT_PX, 0, 0, CUT_PX, CUT_PX);
    context.strokeStyle = "#ffb02e";
    context.lineWidth = 2;
    context.beginPath();
    context.arc(CUT_PX / 2, CUT_PX / 2, 9, 0, 2 * Math.PI);
    context.stroke();
    canvas.dataset.loaded = address;
  });
  picture.src = address;
}
