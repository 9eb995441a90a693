"use strict";
document.documentElement.classList.add("js");

// The slider: left of the cut the baseline, right of it the refined poses. The cut stays where it is on the screen
// while the panorama is scrolled.
for (const figure of document.querySelectorAll(".wipe")) {
  const [slider, scroller, sheet] = ["input", ".scroller", ".sheet"].map((name) => figure.querySelector(name));
  const cut = () => {
    const seen = Math.min(scroller.clientWidth, sheet.offsetWidth);
    sheet.style.setProperty("--cut", `${scroller.scrollLeft + (seen * slider.value) / 100}px`);
  };
  const drag = (event) => {
    if (event.pointerType === "touch" || event.buttons !== 1) return;
    const left = scroller.getBoundingClientRect().left;
    slider.value = (100 * (event.clientX - left)) / scroller.clientWidth;
    cut();
    event.preventDefault();
  };
  slider.addEventListener("input", cut);
  scroller.addEventListener("scroll", cut, { passive: true });
  sheet.addEventListener("pointerdown", drag);
  sheet.addEventListener("pointermove", drag);
  new ResizeObserver(cut).observe(scroller);
}

// Charts tell the values of their curves next to the pointer.
const rounded = (value, size) => {
  const digits = size > 0 ? Math.min(9, Math.max(0, 2 - Math.floor(Math.log10(size)))) : 0;
  return value.toFixed(digits).replace(/^-(?=[0.]*$)/, "").replace("-", "\u2212");
};
for (const chart of document.querySelectorAll(".chart > svg")) {
  const output = chart.parentElement.querySelector("output");
  const numbers = (name) => chart.dataset[name].split(" ").map(Number);
  const [left, right, top, bottom] = numbers("plot");
  const [x, y] = [numbers("x"), numbers("y")];
  const place = chart.dataset.log ? Math.log : (value) => value;
  const value = chart.dataset.log ? Math.exp : (place) => place;
  const curves = [...chart.querySelectorAll("polyline[data-name]")].map((line) => ({
    name: line.dataset.name,
    points: (line.getAttribute("points") || "").split(" ").filter(Boolean).map((pair) => pair.split(",").map(Number)),
  }));
  const cursor = chart.querySelector("line.base").cloneNode();
  cursor.setAttribute("class", "cursor");
  cursor.setAttribute("y1", top);
  cursor.setAttribute("y2", bottom);
  chart.addEventListener("pointermove", (event) => {
    const box = chart.getBoundingClientRect();
    const at = ((event.clientX - box.left) / box.width) * chart.viewBox.baseVal.width;
    const near = curves
      .filter((curve) => curve.points.length)
      .map((curve) => ({
        name: curve.name,
        point: curve.points.reduce((a, b) => (Math.abs(b[0] - at) < Math.abs(a[0] - at) ? b : a)),
      }))
      .filter((found, _, all) => Math.abs(found.point[0] - at) <= 12 || all.length === 1);
    if (!near.length) return;
    const u = near.reduce((a, b) => (Math.abs(b.point[0] - at) < Math.abs(a.point[0] - at) ? b : a)).point[0];
    cursor.setAttribute("x1", u);
    cursor.setAttribute("x2", u);
    chart.append(cursor);
    const read = ({ name, point }) => {
      const share = (bottom - point[1]) / (bottom - top);
      const shown = value(place(y[0]) + share * (place(y[1]) - place(y[0])));
      const text = rounded(shown, chart.dataset.log ? shown : y[1] - y[0]);
      return near.length > 1 ? `${name} ${text}` : text;
    };
    const where = x[0] + ((u - left) / (right - left)) * (x[1] - x[0]);
    output.textContent = `${near.map(read).join(" · ")} at ${rounded(where, Math.abs(x[1] - x[0]))}`;
  });
  chart.addEventListener("pointerleave", () => {
    cursor.remove();
    output.textContent = "";
  });
}
