// The viewer under pointer, touch and keys.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Session } from "./browser/session";
import type { Camera, Seen } from "../../../client/web/view/viewer";

const WIDTH = 300,
  HEIGHT = 200;
const session = new Session(WIDTH, HEIGHT);
const WAIT_MS_MAX = 60_000; // for a condition; ends a test that hangs

async function showRocket(
  size: number,
  options: Record<string, string | number> = {},
): Promise<void> {
  const { daemon, server, browser } = session;
  server.data.set(
    "rocket.voxg",
    await daemon.post("voxelize", "sample.glb", { size, format: "native", ...options }),
  );
  await browser.call("show", "rocket.voxg");
  await browser.call("set", { style: "smooth" });
}

type MouseKind = "mousePressed" | "mouseReleased" | "mouseMoved";
async function mouse(
  type: MouseKind,
  x: number,
  y: number,
  button = "left",
  modifiers = 0,
): Promise<void> {
  const origin = await session.browser.evaluate<[number, number]>(
    "(({ left, top }) => [left, top])(document.querySelector('canvas').getBoundingClientRect())",
  );
  await session.browser.send("Input.dispatchMouseEvent", {
    type,
    x: origin[0] + x,
    y: origin[1] + y,
    button,
    buttons: type === "mouseReleased" ? 0 : button === "left" ? 1 : 2,
    clickCount: 1,
    modifiers,
  });
}

async function drag(
  from: [number, number],
  to: [number, number],
  button = "left",
  modifiers = 0,
): Promise<void> {
  await mouse("mousePressed", ...from, button, modifiers);
  await mouse("mouseMoved", (from[0] + to[0]) / 2, (from[1] + to[1]) / 2, button, modifiers);
  await mouse("mouseMoved", ...to, button, modifiers);
  await mouse("mouseReleased", ...to, button, modifiers);
}

async function key(name: string, text?: string, modifiers = 0): Promise<void> {
  const event = { key: name, modifiers, ...(text ? { text } : {}) };
  await session.browser.send("Input.dispatchKeyEvent", { type: "keyDown", ...event });
  await session.browser.send("Input.dispatchKeyEvent", { type: "keyUp", ...event });
}

/** The first value of a call that is as expected. */
async function eventually<T>(get: () => Promise<T>, isExpected: (value: T) => boolean): Promise<T> {
  for (const end = Date.now() + WAIT_MS_MAX; ; ) {
    const value = await get();
    if (isExpected(value)) return value;
    assert.ok(Date.now() < end, `still ${JSON.stringify(value)}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

const near = (got: number, expected: number, tolerance = 1e-6): void =>
  assert.ok(Math.abs(got - expected) <= tolerance, `${got} is not ${expected}`);

test("a drag turns, the right button and shift pan, the wheel zooms around the pointer", async () => {
  await showRocket(48);
  const { browser } = session;
  await drag([150, 100], [180, 90]);
  let camera = await browser.call("camera");
  near(camera.azimuth, 0); // 30 pixels of 200, 200 degrees over the height
  near(camera.elevation, 10);
  for (const [button, modifiers] of [
    ["right", 0],
    ["left", 8],
  ] as const) {
    const before = await browser.call("camera");
    await drag([150, 100], [170, 90], button, modifiers);
    camera = await browser.call("camera");
    near(camera.pan[0] - before.pan[0], 0.1);
    near(camera.pan[1] - before.pan[1], 0.05);
  }
  // The middle of the voxels is there now.
  const cell = await browser.call("pick", 190, 80),
    zoom = camera.zoom;
  await session.browser.send("Input.dispatchMouseEvent", {
    type: "mouseWheel",
    x: 8 + 190,
    y: 8 + 80,
    deltaX: 0,
    deltaY: -400,
  });
  camera = await eventually(
    () => browser.call("camera"),
    (now) => now.zoom > 1.5 * zoom,
  );
  assert.ok(cell);
  assert.deepEqual((await browser.call("pick", 190, 80))?.cell, cell.cell);
});

test("two fingers zoom", async () => {
  const { browser } = session;
  await browser.call("set", {});
  const touch = (type: string, points: readonly (readonly [number, number])[]): Promise<unknown> =>
    browser.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: points.map(([x, y], id) => ({ x: 8 + x, y: 8 + y, id })),
    });
  await touch("touchStart", [[120, 100]]);
  await touch("touchStart", [
    [120, 100],
    [180, 100],
  ]);
  await touch("touchMove", [
    [90, 100],
    [210, 100],
  ]);
  await touch("touchEnd", []);
  const camera = await browser.call("camera");
  near(camera.zoom, 2, 0.05);
  near(camera.pan[0], 0, 0.05);
});

test("the canvas has the focus's keys: arrows, plus, minus and R", async () => {
  const { browser } = session;
  await browser.call("set", {});
  assert.equal(
    await browser.evaluate(
      "document.querySelector('canvas').focus(), document.activeElement.tagName",
    ),
    "CANVAS",
  );
  await key("ArrowRight");
  await key("ArrowUp");
  let camera = await browser.call("camera");
  near(camera.azimuth, 35);
  near(camera.elevation, 25);
  const { zoom } = camera;
  await key("+", "+");
  near((await browser.call("camera")).zoom, 1.2 * zoom);
  await key("-", "-");
  near((await browser.call("camera")).zoom, zoom);
  await key("ArrowLeft", undefined, 8);
  camera = await browser.call("camera");
  assert.ok(camera.pan[0] < -0.03, `${camera.pan}`);
  await browser.send("Emulation.setEmulatedMedia", {
    features: [{ name: "prefers-reduced-motion", value: "reduce" }],
  });
  await key("r", "r");
  assert.deepEqual(await browser.call("camera"), {
    azimuth: 30,
    elevation: 20,
    zoom: 1,
    pan: [0, 0],
    projection: "perspective",
  });
});

test("the way back to the start ends when a key or the wheel moves the camera", async () => {
  const { browser } = session;
  await browser.send("Emulation.setEmulatedMedia", {
    features: [{ name: "prefers-reduced-motion", value: "no-preference" }],
  });
  for (const event of [
    "new KeyboardEvent('keydown', { key: 'ArrowRight' })",
    "new KeyboardEvent('keydown', { key: 'ArrowRight', shiftKey: true })",
    "new WheelEvent('wheel', { deltaY: -400 })",
  ]) {
    await browser.call("set", { camera: { azimuth: 200 } });
    const [moved, later] = await browser.evaluate<[Camera, Camera]>(`(async () => {
      const canvas = document.querySelector("canvas");
      canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "r" }));
      canvas.dispatchEvent(${event});
      const moved = api.camera();
      await new Promise(requestAnimationFrame); // called after a step of the way
      return [moved, api.camera()];
    })()`);
    assert.deepEqual(later, moved);
  }
  await browser.call("set", {});
});

test("at its limits the zoom does not pan", async () => {
  const { browser } = session,
    camera = { zoom: 1000, pan: [0.1, 0] as const };
  await browser.call("set", { camera });
  await key("+", "+");
  const { zoom, pan } = await browser.call("camera");
  assert.deepEqual({ zoom, pan }, camera);
  await browser.call("set", {});
});

test("nothing is drawn while nothing changes", async () => {
  await session.browser.evaluate("api.atRest().then(() => undefined)");
  assert.equal(await session.browser.call("frameCount", 700), 0);
});

test("a malformed container is refused and the grid before stays", async () => {
  const { browser } = session,
    before = await browser.call("grid");
  assert.equal(
    await browser.call("refusal", "rocket.voxg", 8),
    "DecodeError: grid container, byte 8: version: expected 3, got 252",
  );
  assert.deepEqual(await browser.call("grid"), before);
});

test("a later grid supersedes an earlier one", async () => {
  const { daemon, server, browser } = session;
  server.data.set(
    "large.voxg",
    await daemon.post("voxelize", "sample.ply", { size: 700, format: "native" }),
  );
  assert.deepEqual((await browser.call("showTwo", "large.voxg", "rocket.voxg"))[0], "AbortError");
  assert.equal((await browser.call("grid"))!.dims.includes(48), true);
});

test("the canvas follows the ratio of device pixels", async () => {
  const { browser } = session;
  await browser.send("Emulation.setDeviceMetricsOverride", {
    width: 800,
    height: 600,
    deviceScaleFactor: 2,
    mobile: false,
  });
  await eventually(
    () => browser.call("canvasSize"),
    ([width, height]) => width === 2 * WIDTH && height === 2 * HEIGHT,
  );
  await browser.send("Emulation.clearDeviceMetricsOverride");
});

test("facts of the view: visible cells and pixels of a cell", async () => {
  const { browser } = session;
  await browser.call("set", {});
  const whole = (await browser.call("visibleCells"))!,
    pixels = await browser.call("pixelsPerCell");
  await browser.call("set", { camera: { zoom: 10 } });
  const part = (await browser.call("visibleCells"))!;
  near((await browser.call("pixelsPerCell")) / pixels, 10, 1e-6);
  const height = ({ all: [low, high] }: Seen): number => high[1] - low[1];
  assert.ok(height(part) < height(whole), JSON.stringify([part, whole]));
  for (const c of [0, 1, 2] as const) {
    assert.ok(part.front[0][c] >= part.all[0][c] && part.front[1][c] <= part.all[1][c]);
    assert.ok(part.front[0][c] < part.front[1][c], JSON.stringify(part));
  }
});

test("images have any size up to 4096, and others are refused", async () => {
  const { browser } = session;
  const sizeOf = (width: number, height: number): Promise<string> =>
    browser.evaluate(`api.imageSize(${width}, ${height}).catch((error) => error.message)`);
  assert.equal(await sizeOf(1, 1), "1x1 image/png");
  assert.equal(await sizeOf(4096, 3), "4096x3 image/png");
  assert.equal(await sizeOf(4097, 3), "image side: expected 1 to 4096 pixels, got 4097");
  assert.equal(await sizeOf(0, 3), "image side: expected 1 to 4096 pixels, got 0");
});

test("a missing worker is an error until it is there, and no WebGL2 is no viewer", async () => {
  const { browser } = session;
  assert.deepEqual(await browser.call("refusalsWithoutWorker"), [
    "the viewer's worker did not start",
    "the viewer's worker did not start",
    "grid container, byte 8: the header is cut off: expected 128 bytes, got 8",
  ]);
  assert.equal(await browser.call("hasViewerWithoutWebGl"), false);
});

test("a cleared viewer shows nothing", async () => {
  const { browser } = session;
  const deleted = await browser.evaluate<number>(`(() => {
    const gl = WebGL2RenderingContext.prototype, original = gl.deleteTexture;
    let deleted = 0;
    gl.deleteTexture = function (texture) {
      ++deleted;
      original.call(this, texture);
    };
    api.clear();
    gl.deleteTexture = original;
    return deleted;
  })()`);
  assert.equal(deleted, 4); // nodes, bricks, colours, normals
  assert.equal(await browser.call("grid"), null);
  assert.equal(await browser.call("pick", 150, 100), null);
  assert.equal(await browser.call("visibleCells"), null);
});

test("a canvas can have another viewer after one is disposed of", async () => {
  const { browser } = session;
  await browser.call("dispose");
  assert.equal(await browser.call("open", WIDTH, HEIGHT), true);
  await browser.call("show", "rocket.voxg");
  const found = await browser.call("compareCanvas");
  assert.ok(found.mean < 0.1 && found.drawn > 0.1, JSON.stringify(found));
});
