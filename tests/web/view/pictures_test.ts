// The viewer's images are those of the daemon, for the same grid and camera.
import assert from "node:assert/strict";
import { test } from "node:test";
import { Session } from "./browser/session";
import type { Difference, Settings } from "./browser/page";
import type { Section, Style, Vec3 } from "../../../client/web/view/viewer";

const WIDTH = 240,
  HEIGHT = 180;
// Of 255, over all pixels. One text draws both, but ES has single precision, so rays that graze
// edges may hit other voxels.
const MEAN_MAX = 1;
const session = new Session(WIDTH, HEIGHT);

interface Mesh {
  readonly file: string;
  readonly options: Record<string, string | number>;
}
const ROCKET: Mesh = { file: "sample.glb", options: { size: 96 } };
const SMALL_ROCKET: Mesh = { file: "sample.glb", options: { size: 24 } };
const NORMALS: Mesh = { file: "sample.glb", options: { size: 96, channels: "color,normal" } };
const LABELS: Mesh = {
  file: "sample.obj.zip",
  options: { size: 80, color: "none", channels: "label", labels: "material" },
};
const MATERIALS: Mesh = {
  file: "sample.glb",
  options: { size: 64, color: "none", channels: "material" },
};
const SOLID: Mesh = { file: "sample.off", options: { size: 64, fill: "solid" } };
const COLORED_SOLID: Mesh = { file: "sample.glb", options: { size: 64, fill: "solid" } };
const FINE: Mesh = { file: "sample.ply", options: { size: 400 } };

let numbers = 0;
async function compare(
  mesh: Mesh,
  render: Record<string, string | number>,
  settings: Settings,
  transparent = false,
): Promise<Difference> {
  const name = `picture_${++numbers}`,
    { daemon, server, browser } = session;
  const container = await daemon.post("voxelize", mesh.file, { ...mesh.options, format: "native" });
  server.data.set(`${name}.voxg`, container);
  server.data.set(
    `${name}.png`,
    await daemon.post("render", mesh.file, {
      ...mesh.options,
      width: WIDTH,
      height: HEIGHT,
      ...render,
    }),
  );
  await browser.call("hideCanvas", true); // each of its variants of the shader is compiled for seconds
  await browser.call("show", `${name}.voxg`);
  const png = `${name}.png`;
  const found = await browser.call("compare", settings, png, WIDTH, HEIGHT, transparent, name);
  console.log(
    name,
    JSON.stringify(mesh.options),
    JSON.stringify(render),
    `mean ${found.mean.toFixed(3)}, alpha ${found.meanAlpha.toFixed(3)}, largest ${found.largest}, drawn ${found.drawn.toFixed(2)}`,
  );
  return found;
}

function assertSame({ mean, meanAlpha, drawn }: Difference): void {
  assert.ok(mean <= MEAN_MAX, `mean difference ${mean}`);
  assert.ok(meanAlpha <= MEAN_MAX, `mean difference of alpha ${meanAlpha}`);
  assert.ok(drawn > 0.1, `only ${drawn} of the pixels show something`);
}

// The gate leaves out styles that other tests draw, too.
const isWhole = process.env["VOXELD_LONG"] === "1";
const STYLES: readonly Style[] = isWhole
  ? ["voxel", "smooth", "clay", "iso", "blueprint"]
  : ["voxel", "clay", "blueprint"];
for (const style of STYLES) {
  for (const mesh of [
    ...(isWhole || style !== "blueprint" ? [ROCKET] : []),
    ...(style === "voxel" || style === "blueprint" ? [SMALL_ROCKET] : []),
  ]) {
    test(`style ${style} at size ${mesh.options["size"]} is the daemon's`, async () => {
      // Angles and projection are given, because styles have defaults of their own.
      const render = { style, projection: "perspective", azimuth: 30, elevation: 20 };
      assertSame(await compare(mesh, render, { style }));
    });
  }
}

test("a camera elsewhere is the daemon's", async () => {
  const camera = { azimuth: 205, elevation: -35, zoom: 2.5, projection: "orthographic" } as const;
  assertSame(await compare(ROCKET, camera, { camera }));
  const above = { azimuth: 10, elevation: 90, zoom: 0.7, projection: "perspective" } as const;
  assertSame(await compare(ROCKET, above, { camera: above }));
});

test("stored normals are shaded as the daemon does", async () => {
  assertSame(await compare(NORMALS, { style: "smooth" }, { style: "smooth" }));
  assertSame(await compare(NORMALS, {}, {}));
});

test("labels and materials have the daemon's colours", async () => {
  assertSame(await compare(LABELS, {}, {}));
  assertSame(await compare(LABELS, {}, { channel: "label" }));
  assertSame(
    await compare(
      MATERIALS,
      { style: "iso", projection: "perspective", azimuth: 30, elevation: 20 },
      { style: "iso" },
    ),
  );
});

test("a section plane shows the daemon's caps", async () => {
  for (const [mesh, plane] of [
    [SOLID, [1, 0.2, 0, 0]],
    [COLORED_SOLID, [0, 0, 1, 0]],
    [ROCKET, [-1, 0, 0.5, 0.05]],
  ] as const) {
    const found = await compare(
      mesh,
      { section: plane.join(",") },
      { section: { plane: [...plane], box: null } },
    );
    assertSame(found);
    const whole = await compare(mesh, {}, { section: { plane: [...plane], box: null } });
    assert.ok(whole.mean > MEAN_MAX, "the section is seen");
  }
});

test("a section between cells has the daemon's even caps", async () => {
  await compare(SOLID, {}, {});
  const { origin, voxelSize } = (await session.browser.call("grid"))!,
    y = origin[1] + 20 * voxelSize[1];
  const section: Section = { plane: [0, 1, 0, -y], box: null };
  assertSame(await compare(SOLID, { section: `0,1,0,${-y}` }, { section }));
});

test("small voxels are drawn as a surface, like the daemon's", async () => {
  assertSame(await compare(FINE, {}, {}));
  assertSame(await compare(FINE, { style: "smooth" }, { style: "smooth" }));
  // So close that voxels are cubes of 10 pixels: single precision must find the same ones.
  const camera = { azimuth: 120, elevation: 35, zoom: 20 };
  assertSame(await compare(FINE, camera, { camera }));
});

test("a transparent image has the daemon's alpha", async () => {
  assertSame(await compare(ROCKET, { background: "transparent" }, {}, true));
});

test("channels that the daemon does not draw change the picture", async () => {
  const mesh: Mesh = {
    file: "sample.glb",
    options: { size: 64, channels: "color,normal,coverage" },
  };
  for (const channel of ["normal", "coverage"] as const) {
    const found = await compare(mesh, {}, { channel });
    assert.ok(found.mean > MEAN_MAX, `channel ${channel} is seen: ${found.mean}`);
  }
  assertSame(await compare(mesh, {}, { channel: "color" }));
});

test("a section's box leaves what the daemon's plane leaves", async () => {
  // Seen from below, so that the cut is not seen: a plane has a hatch, a box the voxels' own faces.
  const camera = { azimuth: 30, elevation: -30 };
  await compare(SOLID, camera, { camera });
  const { origin, voxelSize } = (await session.browser.call("grid"))!,
    y = origin[1] + 20 * voxelSize[1];
  const section: Section = {
    plane: null,
    box: [
      [-1e3, -1e3, -1e3],
      [1e3, y, 1e3],
    ],
  };
  assertSame(await compare(SOLID, { ...camera, section: `0,1,0,${-y}` }, { camera, section }));
  const whole = await compare(SOLID, { ...camera, section: `0,1,0,${-y}` }, { camera });
  assert.ok(whole.mean > MEAN_MAX, "the box is seen");
});

test("the canvas at rest shows what image() gives", async () => {
  await compare(ROCKET, {}, {});
  await session.browser.call("hideCanvas", false);
  const found = await session.browser.call("compareCanvas");
  assert.ok(found.mean < 0.1 && found.drawn > 0.1, JSON.stringify(found));
});

if (isWhole) {
  test("an image is of the grid that was shown when it was asked for", async () => {
    await compare(ROCKET, {}, {});
    const rocket = `picture_${numbers}`;
    await compare(SMALL_ROCKET, {}, {});
    const found = await session.browser.call("compareWhileShowing", `${rocket}.voxg`, 1000, 800);
    assert.ok(found.mean === 0 && found.drawn > 0.1, JSON.stringify(found));
    const png = `${rocket}.png`;
    assertSame(await session.browser.call("compare", {}, png, WIDTH, HEIGHT, false, "after"));
  });
}

test("a lost context is rebuilt", async () => {
  await session.browser.call("hideCanvas", false);
  await session.browser.call("loseContext");
  const found = await session.browser.call("compareCanvas");
  assert.ok(found.mean < 0.1 && found.drawn > 0.1, JSON.stringify(found));
});

/** Draws the cells in view, and some around, in the grid's place; returns the first of them. */
async function showPartInView({ file, options }: Mesh): Promise<Vec3> {
  const { daemon, server, browser } = session;
  const { dims } = (await browser.call("grid"))!,
    { front } = (await browser.call("visibleCells"))!;
  const low = front[0].map((v) => Math.max(0, v - 6)),
    high = front[1].map((v, c) => Math.min(dims[c]!, v + 6));
  assert.ok(low.some((v) => v > 0) && high.some((v, c) => v < dims[c]!), `${low} ${high}`);
  const region = [...low, ...high].join();
  server.data.set(
    "part.voxg",
    await daemon.post("voxelize", file, { ...options, format: "native", region }),
  );
  await browser.call("showPart", "part.voxg");
  assertSame(
    await browser.call("compare", null, `picture_${numbers}.png`, WIDTH, HEIGHT, false, "part"),
  );
  return low as unknown as Vec3;
}

test("a part is drawn in the grid's place as the daemon draws the grid", async () => {
  const { browser } = session;
  const camera = { zoom: 5 };
  assertSame(await compare(FINE, { ...camera, style: "smooth" }, { camera, style: "smooth" }));
  await browser.call("hideCanvas", false);
  const whole = await browser.call("grid"),
    hit = (await browser.call("pick", WIDTH / 4, HEIGHT / 5))!;
  const low = await showPartInView(FINE);
  assert.deepEqual(await browser.call("grid"), whole);
  const partly = (await browser.call("pick", WIDTH / 4, HEIGHT / 5))!;
  assert.deepEqual(
    partly.cell.map((v, c) => v + low[c]!),
    hit.cell,
  );
  await browser.call("showPart", null);
  assert.deepEqual(await browser.call("pick", WIDTH / 4, HEIGHT / 5), hit);
});

test("a part of a solid has the whole's colour inside", async () => {
  const section: Section = { plane: [0, 0, 1, 0], box: null },
    camera = { zoom: 5, azimuth: 0, elevation: 0 };
  assertSame(await compare(COLORED_SOLID, { ...camera, section: "0,0,1,0" }, { camera, section }));
  await session.browser.call("hideCanvas", false);
  await showPartInView(COLORED_SOLID);
});

test("nothing broke the page's policy", async () => {
  assert.deepEqual(await session.browser.call("violations"), []);
});
