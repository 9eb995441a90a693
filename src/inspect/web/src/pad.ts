/** Buttons for moving without a keyboard; a pressed button holds its key. */
import type { Walk } from "./walk";

export function wirePad(root: HTMLElement, walk: Walk): void {
  for (const button of root.querySelectorAll<HTMLButtonElement>("[data-key]")) {
    const key = button.dataset.key ?? "";
    button.addEventListener("pointerdown", (event) => {
      button.setPointerCapture(event.pointerId);
      walk.hold(key, true);
    });
    // The capture is lost whenever the press ends.
    button.addEventListener("lostpointercapture", () => walk.hold(key, false));
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}
