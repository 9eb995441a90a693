// Uses the viewer's page as an inspector would, and prints what it saw as JSON.
//
//     node viewer.mjs NODE_MODULES CHROMIUM SCENARIO ADDRESS|FOLDER SCREENSHOT
//
// Scenarios: inspect (a page with a server), again (after a restart), bend, kilometre and static (folders, served
// as they are; static by touch).

import { createServer } from "node:http";
import { createRequire } from "node:module";
import { readFile } from "node:fs/promises";
import { join } from "node:path";

const [modules, executablePath, scenario, place, screenshot] = process.argv.slice(2);
const { chromium } = createRequire(join(modules, "here.js"))("playwright-core");

const KINDS = { html: "text/html", js: "text/javascript", css: "text/css", json: "application/json", jpg: "image/jpeg", glb: "model/gltf-binary" };

/** A web server that knows nothing but files. */
async function hand(folder) {
  const server = createServer(async (request, response) => {
    const name = request.url === "/" ? "/index.html" : request.url.split("?")[0];
    try {
      const bytes = await readFile(join(folder, name));
      response.setHeader("Content-Type", KINDS[name.split(".").pop()] ?? "application/octet-stream").end(bytes);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((listening) => server.listen(0, "127.0.0.1", listening));
  return `http://127.0.0.1:${server.address().port}/`;
}

const address = place.startsWith("http") ? place : await hand(place);
const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage", "--disable-quic"],
});
// A folder is looked at on a tablet, which has no mouse and no keys.
const hasTouch = scenario === "static";
const page = await browser.newPage({ viewport: { width: 1300, height: 760 }, deviceScaleFactor: 1, hasTouch, isMobile: hasTouch });
const problems = [];
page.on("console", (message) => message.type() === "error" && problems.push(message.text()));
page.on("pageerror", (error) => problems.push(String(error)));
page.on("dialog", (dialog) => dialog.accept());
const seen = { problems };

const complete = () => page.waitForFunction(() => document.body.dataset.loading === "0", null, { timeout: 60_000 });
const number = (text, pattern) => Number(pattern.exec(text)?.[1] ?? NaN);
/** Where the page says you are. */
const where = async () => {
  const place = await page.textContent("#place");
  return {
    h: number(place, /at (-?[\d.]+) m/),
    fromWall: number(place, /([\d.]+) m from the wall/),
    seen: number(place, /looking at (-?[\d.]+) m/),
    clock: /, (\d+:\d\d) o'clock/.exec(place)?.[1],
  };
};
/** Waits until the page is drawn so many times. */
const drawn = (times) =>
  page.evaluate(async (times) => {
    for (let k = 0; k < times; k++) await new Promise(requestAnimationFrame);
  }, times);
/** The next state of what is told now and then, as the page is drawn. */
const told = async () => {
  await complete();
  await page.waitForTimeout(900);
  await drawn(2);
  const statistics = await page.textContent("#statistics");
  return {
    ...(await where()),
    triangles: number(statistics, /(\d+) triangles/),
    textureMiB: number(statistics, /([\d.]+) MiB/),
    hash: new URL(page.url()).hash,
  };
};
const go = async (hash) => {
  await page.evaluate((hash) => (location.hash = hash), hash);
  return told();
};
/** Waits until it is enough, by where you are and were; how fast one walks depends on how fast the page is drawn. */
const until = async (enough) => {
  for (let k = 0, before = await where(); k < 40; k++) {
    await page.waitForTimeout(500);
    await drawn(3);
    const now = await where();
    if (enough(now, before)) break;
    before = now;
  }
};
const hold = async (keys, enough) => {
  for (const key of keys) await page.keyboard.down(key);
  await until(enough);
  for (const key of keys) await page.keyboard.up(key);
  return told();
};
/** As near to the wall as one gets. */
const stopped = (now, before) => now.fromWall < 0.5 && now.fromWall === before.fromWall;
const ride = async (metres) => {
  const from = (await told()).h;
  await page.keyboard.press("Space");
  await until((now) => now.h > from + metres);
  await page.keyboard.press("Space");
  return told();
};
const marks = () => page.$$eval("#marks li button:first-child", (rows) => rows.map((row) => row.textContent));

/** Centres of the bright dots in the view, from left to right. */
async function dots() {
  const picture = (await page.screenshot({ type: "png", clip: { x: 140, y: 60, width: 850, height: 500 } })).toString("base64");
  return page.evaluate(async (picture) => {
    const image = new Image();
    image.src = `data:image/png;base64,${picture}`;
    await image.decode();
    const context = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height }).getContext("2d");
    context.drawImage(image, 0, 0);
    const { data, width, height } = context.getImageData(0, 0, image.width, image.height);
    const groups = [];
    for (let y = 0; y < height; y++) {
      for (let x = 0; x < width; x++) {
        // The cross in the middle is no dot.
        if (data[4 * (y * width + x)] < 200 || Math.hypot(x + 140 - 650, y + 60 - 380) < 12) continue;
        let group = groups.find((group) => Math.hypot(group.x / group.n - x, group.y / group.n - y) < 40);
        if (!group) groups.push((group = { x: 0, y: 0, n: 0 }));
        [group.x, group.y, group.n] = [group.x + x, group.y + y, group.n + 1];
      }
    }
    const large = groups.filter((group) => group.n > 30);
    // The centre of the first pixel is half a pixel from the edge.
    return large.map(({ x, y, n }) => [x / n + 140.5, y / n + 60.5]).sort((a, b) => a[0] - b[0]);
  }, picture);
}

/** Fingers touch, move from places to places, and leave when `then` is over. */
async function fingers(places, then = async () => {}) {
  const session = await page.context().newCDPSession(page);
  const send = (type, points) =>
    session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y], id) => ({ x, y, id })) });
  await send("touchStart", places[0]);
  for (const points of places.slice(1)) await send("touchMove", points);
  await then();
  await send("touchEnd", []);
}

async function save(code) {
  await page.fill("#panel input[name=class]", code);
  await page.fill("#panel textarea", 'wet, "open"');
  await page.click("#save");
  await page.waitForSelector("#panel", { state: "hidden" });
}

const scenarios = {
  async inspect() {
    await page.goto(address);
    seen.start = await told();
    seen.ahead = await hold(["w"], (now) => now.h > seen.start.h + 0.2);
    seen.wall = await go("#h=1.2&clock=3:00");
    seen.against = await hold(["w", "Shift"], stopped);
    const box = await (await page.$("#whole")).boundingBox();
    await page.mouse.click(box.x + box.width * 0.25, box.y + 5);
    seen.jumped = await told();
    seen.ridden = await ride(0.2);

    seen.target = await go("#h=1.2&clock=3:00");
    seen.dots = await dots();
    await page.screenshot({ path: screenshot });
    await page.keyboard.press("3");
    for (const [x, y] of seen.dots.slice(0, 2)) await page.mouse.click(x, y);
    seen.length = await page.textContent("#measured");
    await save("BAB crack");

    await page.keyboard.press("2");
    await page.mouse.click(500, 330);
    await save("BBF infiltration");
    seen.marks = await marks();

    await page.keyboard.press("5");
    await page.mouse.click(...seen.dots[0]);
    await page.waitForFunction(() => document.querySelector("#panel canvas")?.dataset.loaded);
    seen.sighting = await page.textContent("#sighting");
    // What the frame shows under the ring: the dot.
    seen.middle = await page.$eval("#panel canvas", (canvas) => {
      const { data } = canvas.getContext("2d").getImageData(119, 119, 3, 3);
      return data.filter((_, k) => k % 4 === 0).reduce((a, b) => a + b) / 9;
    });
    await page.keyboard.press("Escape");

    await page.keyboard.press("c");
    await page.click("[data-layer=baseline]");
    seen.baseline = await told();
    await page.reload();
    seen.reloaded = await told();
    seen.kept = await marks();
  },
  async again() {
    await page.goto(address);
    await told();
    seen.kept = await marks();
    await page.click("#marks li button:last-child");
    await page.waitForFunction(() => document.querySelectorAll("#marks li").length === 1);
  },
  async bend() {
    await page.goto(address + "#h=6&clock=3:00");
    seen.start = await told();
    await page.screenshot({ path: screenshot });
    seen.against = await hold(["w", "Shift"], stopped);
    await go("#h=1&clock=6:00");
    seen.ridden = await ride(0.5);
  },
  async kilometre() {
    await page.goto(address);
    seen.places = [await told()];
    for (let h = 0; h <= 1000; h += 50) seen.places.push(await go(`#h=${h}&clock=${1 + (h % 12)}:00`));
    await go("#h=0&clock=3:00");
    await page.mouse.move(650, 300);
    for (let k = 0; k < 14; k++) await page.mouse.wheel(0, -100);
    await page.keyboard.press("Space");
    for (let k = 0; k < 40; k++) {
      await page.waitForTimeout(1000);
      const [, triangles, textureMiB] = /(\d+) triangles, ([\d.]+) MiB/.exec(await page.textContent("#statistics"));
      seen.places.push({ triangles: Number(triangles), textureMiB: Number(textureMiB) });
    }
  },
  async static() {
    await page.goto(address + "#h=1.2&clock=3:00");
    seen.start = await told();
    seen.frames = await page.isVisible("[data-tool=frames]");
    await fingers([[[700, 400]], [[600, 400]], [[500, 400]]]);
    seen.turned = await told();
    await go("#h=1.2&clock=3:00");
    await fingers([[[600, 400], [640, 400]], [[560, 400], [680, 400]], [[520, 400], [720, 400]]]);
    seen.pinched = await told();
    const pad = await (await page.$("[data-key=KeyW]")).boundingBox();
    await fingers([[[pad.x + 20, pad.y + 20]]], () => until(stopped));
    seen.against = await told();

    await go("#h=1.2&clock=3:00");
    await page.tap("[data-tool=length]");
    for (const x of [500, 560]) await page.touchscreen.tap(x, 330);
    seen.length = await page.textContent("#measured");
    await save('BAB, "long"');
    await page.tap("[data-tool=mark]");
    await page.touchscreen.tap(500, 330);
    await save("BBF");
    await page.reload();
    await told();
    seen.kept = await marks();
    const saved = async (name) => {
      const [download] = await Promise.all([page.waitForEvent("download"), page.tap(`#marks button:text-is("${name}")`)]);
      return readFile(await download.path(), "utf8");
    };
    [seen.geojson, seen.csv] = [await saved("GeoJSON"), await saved("CSV")];
  },
};

try {
  await scenarios[scenario]();
  console.log(JSON.stringify(seen));
} catch (error) {
  console.log(JSON.stringify({ ...seen, failed: String(error) }));
} finally {
  await browser.close();
  process.exit();
}
