/** Buttons to move by where there is no keyboard: while one is pressed, its key is held. */
import type { Walk } from "./walk";

export function wirePad(root: HTMLElement, walk: Walk): void {
  for (const button of root.querySelectorAll<HTMLButtonElement>("[data-key]")) {
    const key = button.dataset.key ?? "";
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      walk.hold(key, true);
    });
    // However the press ends, the capture is lost.
    button.addEventListener("lostpointercapture", () => walk.hold(key, false));
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}
