// The page as a person uses it: dropped files, progress, downloads, keys, a daemon that goes away.
import { execFileSync } from "node:child_process";
import { readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import http from "node:http";
import { join } from "node:path";
import { expect, test } from "@playwright/test";
import { Daemon, run, temporaryFolder } from "./daemon.mjs";

const fixtures = temporaryFolder("web-fixtures");
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
let daemon;

test.beforeAll(async () => {
  run("voxeld_make_fixtures", [fixtures]);
  daemon = await new Daemon().start();
});
test.afterAll(() => daemon?.end());

// A software driver compiles the ray march for seconds in each page and casts some 50 rays for each
// pixel at rest. So pages draw in tests with this tag alone, and a quarter of the pixels.
const DRAWN = { tag: "@drawn" };

// No test may violate the policy or end a script with an error.
test.beforeEach(async ({ page, context }, info) => {
  page.faults = [];
  page.on("pageerror", error => page.faults.push(String(error.stack)));
  page.on("console", message => {
    if (/Content Security Policy/.test(message.text())) page.faults.push(message.text());
  });
  await page.addInitScript(() => {
    window.violations = [];
    document.addEventListener("securitypolicyviolation", event =>
      window.violations.push(event.violatedDirective),
    );
    // Notes vanish after some seconds.
    window.notes = new Set();
    new MutationObserver(() => {
      window.notes.add(document.getElementById("status")?.textContent ?? "");
    }).observe(document, { subtree: true, childList: true, characterData: true });
  });
  // Expected seconds do not depend on the machine: a job of at most 256 cells a side starts by
  // itself, a larger one waits for a click. The end of the range must not matter.
  await context.addInitScript(() => {
    const original = window.fetch;
    window.fetch = async (path, init) => {
      const response = await original(path, init);
      if (!response.ok || !String(path).includes("dry_run")) return response;
      const price = await response.json();
      const isSmall = JSON.parse(init.body).options.size <= 256;
      const seconds = { seconds_low: 0.1, seconds: isSmall ? 0.2 : 60, seconds_high: 600 };
      price.estimate = { ...price.estimate, ...seconds };
      return Response.json(price, response);
    };
  });
  await context.addInitScript(isDrawn => {
    const gl = WebGL2RenderingContext.prototype;
    if (isDrawn) Object.defineProperty(window, "devicePixelRatio", { get: () => 0.5 });
    else gl.drawArrays = () => undefined;
    // All that the viewer calls again and again while it draws.
    window.calls = 0;
    for (const name of ["clientWaitSync", "getProgramParameter"]) {
      const original = gl[name];
      gl[name] = function (...given) {
        ++window.calls;
        return original.apply(this, given);
      };
    }
  }, info.tags.includes(DRAWN.tag));
});
test.afterEach(async ({ page }) => {
  expect(page.faults).toEqual([]);
  if (page.url().startsWith("http"))
    expect(await page.evaluate(() => window.violations)).toEqual([]);
});

/** Drops files of the disk on the page, as one drag. */
async function drop(page, ...paths) {
  const files = paths.map(path => ({
    name: path.split("/").pop(),
    data: readFileSync(path).toString("base64"),
  }));
  const transfer = await page.evaluateHandle(given => {
    const transfer = new DataTransfer();
    for (const { name, data } of given) {
      transfer.items.add(new File([Uint8Array.from(atob(data), c => c.charCodeAt(0))], name));
    }
    return transfer;
  }, files);
  await page.dispatchEvent("#view", "drop", { dataTransfer: transfer });
}

/** Waits until voxels of the wanted size are shown. Hidden facts are those of the mesh before. */
async function shown(page, side) {
  await expect(page.locator("#facts:not([hidden])")).toHaveText(
    new RegExp(`voxels, .*\\b${side}\\b(?!.*Preview)`),
  );
}

/** Waits until the page has told something. */
async function told(page, text) {
  await expect.poll(() => page.evaluate(() => [...window.notes].join("\n"))).toContain(text);
}

/** Waits until the view draws no more. */
async function settled(page) {
  // Turns of the page's own thread: it looks at the driver and at its timers in each of them.
  await page.evaluate(async () => {
    for (let quiet = 0, before = -1; quiet < 5; ) {
      await new Promise(requestAnimationFrame);
      await new Promise(resolve => setTimeout(resolve, 100));
      quiet = window.calls === before ? quiet + 1 : 0;
      before = window.calls;
    }
  });
}

/** Types a size, once the mesh is there. */
async function resize(page, size) {
  await expect(page.locator("#card-model")).toContainText("triangles");
  await page.fill("#size", String(size));
  await page.press("#size", "Enter");
}

/** Starts a run that takes longer than its test, and waits until its preview is over. */
async function startLongRun(page) {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await resize(page, 8192);
  await page.click("#run");
  await expect(page.locator("#job")).toHaveText(/^(Voxelizing|Waiting)/); // behind the preview
}

/** Whether the canvas or picture shows more than one colour. */
async function hasPicture(page) {
  const shot = await page.locator("#view").screenshot();
  return await page.evaluate(async data => {
    const image = await createImageBitmap(
      new Blob([Uint8Array.from(atob(data), c => c.charCodeAt(0))]),
    );
    const canvas = new OffscreenCanvas(image.width, image.height),
      context = canvas.getContext("2d");
    context.drawImage(image, 0, 0);
    const { data: pixels } = context.getImageData(
      image.width * 0.3,
      image.height * 0.2,
      image.width * 0.4,
      image.height * 0.6,
    );
    const seen = new Set();
    for (let i = 0; i < pixels.length; i += 4 * 37)
      seen.add(((pixels[i] >> 4) << 8) | ((pixels[i + 1] >> 4) << 4) | (pixels[i + 2] >> 4));
    return seen.size > 12;
  }, shot.toString("base64"));
}

async function seriousFindings(page) {
  await page.evaluate(axe);
  const results = await page.evaluate(() =>
    window.axe.run({ runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"] }),
  );
  return results.violations
    .filter(one => one.impact === "serious" || one.impact === "critical")
    .map(
      one =>
        `${one.id}: ${one.nodes
          .map(node => node.target + " " + node.failureSummary)
          .join("; ")
          .slice(0, 400)}`,
    );
}

async function download(page, action) {
  const [event] = await Promise.all([page.waitForEvent("download"), action()]);
  return { name: event.suggestedFilename(), bytes: readFileSync(await event.path()) };
}

test("a dropped mesh is described, shown, and saved with the bytes of the CLI", DRAWN, async ({
  page,
}) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#card-model")).toContainText("25,600 triangles");
  await expect(page.locator("#card-model")).toContainText("watertight");
  await settled(page);
  expect(await hasPicture(page)).toBe(true);
  await page.selectOption("#format", "npz");
  await expect(page.locator("#card-take")).toContainText(/about [\d.]+ [KM]B/);
  const taken = await download(page, () => page.click("#card-take button.primary"));
  expect(taken.name).toBe("sample.npz");
  const own = join(temporaryFolder("web-cli"), "own.npz");
  run("voxel", ["--url", daemon.url, join(fixtures, "sample.ply"), "--size", "256", "-o", own]);
  expect(taken.bytes.equals(readFileSync(own))).toBe(true);
});

/** The numbers of the cell that a text tells. */
function cellOf(text) {
  return text.match(/-?\d+/g).slice(0, 3).map(Number);
}

test("a double click marks a voxel, and others tell how far they are from it", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  const canvas = page.locator("#canvas");
  const box = await canvas.boundingBox();
  const middle = { x: box.width / 2, y: box.height / 2 };
  await canvas.hover({ position: middle });
  await expect(page.locator("#pick")).toContainText(/cell/i);
  await expect(page.locator("#pick")).not.toContainText("from the mark");
  await canvas.dblclick({ position: middle });
  await expect(page.locator("#pick")).toContainText("0, 0, 0 cells from the mark: 0");
  const from = cellOf(await page.locator("#pick").textContent());
  await canvas.hover({ position: { x: middle.x + box.height / 20, y: middle.y + box.height / 20 } });
  await expect(page.locator("#pick")).not.toContainText("0, 0, 0 cells from the mark");
  const text = await page.locator("#pick").textContent();
  const to = cellOf(text);
  expect(text).toContain(`${to.map((c, k) => c - from[k]).join(", ")} cells from the mark: `);
  await canvas.dblclick({ position: { x: box.width / 12, y: box.height / 12 } });
  await canvas.hover({ position: middle });
  await expect(page.locator("#pick")).not.toContainText("from the mark");
});

test("the voxel under the pointer goes with its grid", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await page.locator("#canvas").hover(); // its middle
  await expect(page.locator("#pick")).toContainText(/cell/i);
  await resize(page, 64);
  await shown(page, 64);
  await expect(page.locator("#pick")).toBeHidden();
});

test("a close camera sees the voxels of a large grid", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  const asked = []; // sizes
  page.on("request", request => {
    if (request.url().endsWith("/v1/jobs")) asked.push(request.postDataJSON()?.options?.size);
  });
  await resize(page, 2048);
  await page.click("#run");
  await shown(page, 2048);
  expect(asked.slice(-3)).toEqual([128, 1024, 2048]);
  await expect(page.locator("#facts")).toContainText("shown at 1:2");
  const regions = [];
  page.on("request", request => regions.push(new URL(request.url()).searchParams.get("region")));
  const canvas = page.locator("#canvas");
  const box = await canvas.boundingBox();
  // Cells under a row of points: those that are shown, and those of the finest level among them.
  const cells = async () => {
    const found = { all: 0, odd: 0 };
    for (let i = -6; i <= 6; ++i) {
      await canvas.hover({ position: { x: box.width / 2 + 16 * i, y: box.height / 2 + i } });
      if (await page.locator("#pick").isHidden()) continue;
      ++found.all;
      const cell = cellOf(await page.locator("#pick").textContent());
      if (cell.some(c => c % 2 !== 0)) ++found.odd;
    }
    return found;
  };
  const before = await cells();
  expect(before.odd).toBe(0);
  expect(before.all).toBeGreaterThan(3);
  for (let i = 0; i < 4; ++i) await page.mouse.wheel(0, -300);
  await expect.poll(async () => (await cells()).odd).toBeGreaterThan(1);
  expect(regions.filter(region => region !== null).length).toBeGreaterThan(0);
  await page.click("#reset");
  await expect.poll(async () => (await cells()).odd).toBe(0);
});

/** The files of a sample, written to a folder of their own. */
async function sampleFiles(page, name) {
  const script = execFileSync(
    "esbuild",
    [
      join(process.env.VOXELD_ROOT_DIR, "client/web/app/samples.ts"),
      "--bundle",
      "--global-name=own",
    ],
    { encoding: "utf8" },
  );
  const files = await page.evaluate(
    `(async () => {
      ${script}
      const files = await own.samples.find(one => one.name === ${JSON.stringify(name)}).make();
      return Promise.all(files.map(async ({ name, blob }) => [
        name,
        Array.from(new Uint8Array(await blob.arrayBuffer())),
      ]));
    })()`,
  );
  const folder = temporaryFolder("web-sample");
  for (const [file, bytes] of files) writeFileSync(join(folder, file), Uint8Array.from(bytes));
  return folder;
}

for (const [name, size, ...formats] of [
  ["Rocket", 48, "vox", "slices Channel=color", "schem Dithering=bayer Blocks=wool"],
  ["Planet", 40, "ply"], // a bundle
  ["Worm", 16, "vox", "xyz"], // an animation: one file, and a zip of a file for each frame
]) {
  test(`commands that the page shows for the ${name} make the same bytes`, async ({ page }) => {
    await page.goto(daemon.url);
    await page.click(`.sample:has-text("${name}")`);
    await resize(page, size);
    await shown(page, size);
    const files = await sampleFiles(page, `sample${name}`);
    await page.click("#commands summary");
    for (const wanted of formats) {
      const [format, ...choices] = wanted.split(" ");
      await page.selectOption("#format", format);
      for (const [label, value] of choices.map(choice => choice.split("="))) {
        await page.locator("#card-take").getByLabel(label, { exact: true }).selectOption(value);
      }
      const taken = await download(page, () => page.click("#card-take button.primary"));
      for (const language of ["curl", "CLI", "Python"]) {
        await page.click(`#commands button:text-is("${language}")`);
        const folder = temporaryFolder("web-commands");
        execFileSync("cp", ["-r", `${files}/.`, folder]);
        const [program, flags] =
          language === "Python" ? ["/usr/bin/python3", ["-Bc"]] : ["sh", ["-ec"]];
        execFileSync(program, [...flags, await page.textContent("#commands pre")], {
          cwd: folder,
          stdio: "pipe",
          env: {
            ...process.env,
            PATH: `${process.env.VOXELD_BIN_DIR}:${process.env.PATH}`,
            PYTHONPATH: join(process.env.VOXELD_ROOT_DIR, "python"),
          },
        });
        const made = readFileSync(join(folder, taken.name));
        expect(made.equals(taken.bytes), `${wanted} by ${language}`).toBe(true);
      }
    }
  });
}

test("the samples become voxels, one after the other", DRAWN, async ({ page }) => {
  await page.goto(daemon.url);
  for (const [name, fact] of [
    ["Rocket", "watertight"],
    ["Planet", "1 texture"],
    ["Knot", "watertight"],
  ]) {
    await test.step(name, async () => {
      await page.click(`.sample:has-text("${name}")`);
      await shown(page, 256);
      await expect(page.locator("#card-model")).toContainText(fact);
      await expect(page.locator("#card-model .warn")).toBeHidden();
      await settled(page);
      expect(await hasPicture(page)).toBe(true);
      await page.click("#new");
    });
  }
});

test("a grid without voxels has none, and is no animation", async ({ page }) => {
  await page.route("**/v1/jobs/*", async route => {
    const response = await route.fetch(),
      job = await response.json();
    if (job.result?.meta) job.result.meta.voxel_count = 0;
    await route.fulfill({ response, json: job });
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#facts")).toHaveText(/^0 voxels, /);
});

test("an animation has a timeline that plays", async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await expect(page.locator("#timeline")).toBeVisible();
  await expect(page.locator("#card-model")).toContainText("1 animation");
  await shown(page, 128);
  const frame = page.locator("#timeline output");
  await expect(frame).toHaveText(/^1 \/ \d\d/);
  await expect(page.locator("#commands pre")).toContainText("size=128"); // all frames are there
  await expect(frame).toHaveAttribute("aria-live", "off");
  await page.click("#timeline button");
  await expect(frame).not.toHaveText(/^1 \//);
  await page.click("#timeline button");
  await page.locator("#timeline input").fill("3");
  await expect(frame).toHaveText(/^4 \//);
});

test("a frame that does not come is a problem, and the animation plays on", async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await expect(page.locator("#commands pre")).toContainText("size=16"); // all frames are there
  await page.route("**/frames/6*", route =>
    route.fulfill({ status: 400, json: { code: "test", detail: "frame 6 is lost" } }),
  );
  const frame = page.locator("#timeline output"),
    play = page.locator("#timeline button");
  await page.locator("#timeline input").fill("6");
  await expect(page.locator("#banner")).toContainText("frame 6 is lost");
  await expect(play).toHaveText("Play");
  await page.unroute("**/frames/6*");
  await play.click();
  await expect(play).toHaveText("Pause");
  await expect(frame).not.toHaveText(/^7 \//);
});

test("a frame that does not come is no problem once its mesh was left", async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  const path = "**/frames/6*";
  await page.route(path, async route => {
    await held;
    await route.fulfill({ status: 400, json: { code: "test", detail: "frame 6 is lost" } });
  });
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await expect(page.locator("#commands pre")).toContainText("size=16"); // all frames are there
  const asked = page.waitForRequest(path);
  await page.locator("#timeline input").fill("6");
  await asked;
  await page.click("#new");
  const came = page.waitForResponse(path);
  release();
  await came;
  // Another response: the page has read that one by then.
  await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
  await expect(page.locator("#banner")).toBeHidden();
});

test("an animation that plays ends with its mesh, and the next one begins anew", async ({ page }) => {
  const frame = page.locator("#timeline output");
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await shown(page, 16);
  await page.click("#timeline button");
  await expect(frame).not.toHaveText(/^1 \//);
  await page.click("#new");
  await page.click('.sample:has-text("Worm")');
  await shown(page, 16);
  await expect(frame).toHaveText(/^1 \/ \d\d/);
  await expect(page.locator("#timeline button")).toHaveText("Play");
  await expect(page.locator("#banner")).toBeHidden();
});

test("of two plays with a pause between them the later one goes on", async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await expect(page.locator("#commands pre")).toContainText("size=16"); // all frames are there
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/frames/*", async route => {
    await held;
    await route.continue();
  });
  const play = page.locator("#timeline button");
  const asked = page.waitForRequest("**/frames/*");
  await play.click();
  await asked; // the loop waits for a frame
  await page.waitForTimeout(400); // by so much a second loop would be elsewhere
  await play.click();
  await play.click();
  const came = page.waitForResponse("**/frames/*");
  release();
  await came;
  const { back, elapsed, frames } = await page.evaluate(async () => {
    const [input, output] = ["input", "output"].map(name =>
      document.querySelector(`#timeline ${name}`),
    );
    const begin = performance.now();
    let back = 0;
    for (let i = 0, last = 0; i < 90; ++i) {
      await new Promise(requestAnimationFrame);
      const frame = parseInt(output.textContent);
      if (frame < last) ++back;
      last = frame;
    }
    return { back, elapsed: performance.now() - begin, frames: Number(input.max) + 1 };
  });
  // Back from the end to the beginning, at 24 frames a second.
  expect(back).toBeLessThanOrEqual(2 + (elapsed * 24) / 1000 / frames);
});

test("several files are one mesh, and a missing texture is named and added later", async ({
  page,
}) => {
  const folder = temporaryFolder("web-bundle");
  execFileSync("unzip", ["-q", join(fixtures, "sample.obj.zip"), "-d", folder]);
  const files = execFileSync("find", [folder, "-type", "f"], { encoding: "utf8" })
    .trim()
    .split("\n");
  const textures = files.filter(name => name.endsWith(".png")),
    others = files.filter(name => !name.endsWith(".png"));
  await page.goto(daemon.url);
  await drop(page, ...others);
  await expect(page.locator("#card-model .warn")).toContainText(textures[0].split("/").pop());
  await drop(page, ...textures);
  await expect(page.locator("#card-model .warn")).toBeHidden(); // until the mesh is described again
  await expect(page.locator("#card-model")).toContainText("2 textures");
  await expect(page.locator("#card-model .warn")).toBeHidden();
  await shown(page, 256);
});

test("of two meshes dropped at once the later one is loaded", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 32);
  await shown(page, 32);
  const sent = [];
  page.on("request", request => {
    if (request.method() === "POST") sent.push(request.postData() ?? "");
  });
  const text = name => readFileSync(join(fixtures, name), "utf8");
  await page.evaluate(
    files => {
      for (const [name, text] of files) {
        const dataTransfer = new DataTransfer();
        dataTransfer.items.add(new File([text], name));
        document
          .getElementById("view")
          .dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
      }
    },
    [
      ["first.obj", text("concave.obj")],
      ["second.off", text("sample.off")],
    ],
  );
  await expect(page.locator("#card-model h2")).toHaveText("second");
  await expect(page.locator("#card-model")).toContainText("OFF");
  await shown(page, 32);
  expect(sent.filter(body => body.includes("second.off"))).not.toEqual([]);
  expect(sent.filter(body => body.includes("first.obj"))).toEqual([]);
});

test("a folder that is read for long does not supersede a mesh dropped later", async ({ page }) => {
  await page.goto(daemon.url);
  await page.evaluate(() => {
    const file = resolve => resolve(new File(["v 0 0 0"], "slow.obj"));
    const entries = [{ name: "slow.obj", isFile: true, file }];
    const readEntries = resolve => {
      // The first entries are held, the next ones are none.
      if (window.release) resolve([]);
      else window.release = () => resolve(entries);
    };
    const folder = { name: "slow", isDirectory: true, createReader: () => ({ readEntries }) };
    const item = DataTransferItem.prototype,
      original = item.webkitGetAsEntry;
    item.webkitGetAsEntry = () => folder;
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([""], "slow"));
    document
      .getElementById("view")
      .dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true }));
    item.webkitGetAsEntry = original;
  });
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  // A page that begins with the folder's mesh has done so before a response comes.
  await page.evaluate(async () => {
    window.release();
    await (await fetch("/v1/me")).blob();
  });
  await expect(page.locator("#card-model h2")).toHaveText("sample");
});

test("a grid that comes after its mesh was left tells nothing", async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/v1/grids/*", async route => {
    await held;
    await route.continue();
  });
  await page.goto(daemon.url);
  const asked = page.waitForRequest("**/v1/grids/*");
  await drop(page, join(fixtures, "sample.ply"));
  await asked;
  await page.click("#new");
  const came = page.waitForResponse("**/v1/grids/*");
  release();
  const url = (await came).url();
  // The same bytes once more: the page has read its own by then.
  await page.evaluate(async url => (await (await fetch(url)).blob()).arrayBuffer(), url);
  await expect(page.locator("#start")).toBeVisible();
  await expect(page.locator("#facts")).toBeHidden();
});

test("a grid that comes after the next one tells nothing", async ({ page }) => {
  let isFirst = true,
    release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/v1/grids/*", async route => {
    if (isFirst) {
      isFirst = false;
      await held;
    }
    await route.continue();
  });
  await page.goto(daemon.url);
  const asked = page.waitForRequest("**/v1/grids/*");
  await drop(page, join(fixtures, "sample.ply"));
  const url = (await asked).url();
  await resize(page, 64);
  await shown(page, 64);
  const came = page.waitForResponse(url);
  release();
  await came;
  // The same bytes once more: the page has read its own by then.
  await page.evaluate(async url => (await (await fetch(url)).blob()).arrayBuffer(), url);
  await shown(page, 64);
});

test("an upload shows its progress, and a known file is not sent again", async ({ page }) => {
  await page.goto(daemon.url);
  const client = await page.context().newCDPSession(page);
  await client.send("Network.enable");
  await client.send("Network.emulateNetworkConditions", {
    offline: false,
    latency: 0,
    downloadThroughput: -1,
    uploadThroughput: 20_000, // over a minute, if it were not lifted
  });
  await drop(page, join(fixtures, "sample.stl"));
  await expect(page.locator("#over progress")).toBeVisible();
  await expect(page.locator("#over")).toContainText(
    /Uploading sample\.stl: [\d.]+ [KM]?B of 1\.3 MB/,
  );
  await client.send("Network.emulateNetworkConditions", {
    offline: false,
    latency: 0,
    downloadThroughput: -1,
    uploadThroughput: -1,
  });
  await shown(page, 256);
  const posts = [];
  page.on("request", request => {
    if (request.method() === "POST") posts.push(new URL(request.url()).pathname);
  });
  await page.click("#new");
  await drop(page, join(fixtures, "sample.stl"));
  await shown(page, 256);
  expect(posts).not.toContain("/v1/assets");
});

test("a job of a superseded setting is cancelled, and cancel ends the last", async ({ page }) => {
  await startLongRun(page);
  await expect(page.locator("#cancel")).toBeVisible();
  await expect(page.locator("#price")).toContainText("memory");
  await resize(page, 8000);
  await expect
    .poll(async () =>
      (await daemon.json("/v1/jobs?state=cancelled")).jobs.map(job => job.options?.size),
    )
    .toContain(8192);
  await page.click("#run");
  await page.click("#cancel");
  await expect(page.locator("#job")).toHaveText("Cancelled.");
  await expect(page.locator("#cancel")).toBeHidden();
});

test("a preview that is superseded is cancelled, known to the page or not", async ({ page }) => {
  const previews = []; // that are made so large that they are superseded
  let release = () => undefined;
  await page.route("**/v1/jobs", async route => {
    const body = route.request().postDataJSON();
    if (body?.options?.size !== 128 || body.priority !== 10) return await route.continue();
    const response = await route.fetch({
      postData: JSON.stringify({ ...body, options: { ...body.options, size: 8192 } }),
      timeout: 0,
    });
    previews.push((await response.json()).id);
    if (previews.length === 2) await new Promise(resolve => (release = resolve));
    await route.fulfill({ response });
  });
  const start = async size => {
    await resize(page, size);
    await page.click("#run");
  };
  const cancelled = async () =>
    (await daemon.json("/v1/jobs?state=cancelled&limit=100")).jobs.map(job => job.id);
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 64);
  await shown(page, 64);
  await start(3000);
  await expect(page.locator("#job")).toHaveText(/^Preview/);
  await start(3001); // supersedes a preview that runs
  await expect.poll(cancelled).toContain(previews[0]);
  await expect.poll(() => previews.length).toBe(2);
  const priced = page.waitForResponse(response => response.url().includes("dry_run"));
  await page.fill("#size", "64"); // supersedes one whose request is under way
  await page.press("#size", "Enter");
  await priced;
  release();
  await expect.poll(cancelled).toContain(previews[1]);
  await shown(page, 64);
});

test("a change of the settings supersedes a run whose price is asked for", async ({ page }) => {
  // The price of the new settings, which would supersede it later, is never asked for.
  await page.addInitScript(() => {
    const original = window.setTimeout;
    window.setTimeout = (call, ms, ...given) => (ms === 140 ? 0 : original(call, ms, ...given));
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await expect(page.locator("#card-take")).toContainText("about"); // the first run has ended
  await page.route(/dry_run/, () => undefined); // no response
  const asked = page.waitForRequest(/dry_run/);
  await page.click("#run");
  await asked;
  const given = page.waitForEvent("requestfailed", request => request.url().includes("dry_run"));
  await resize(page, 64);
  await given;
});

test("cancel ends a run whose price is asked for", async ({ page }) => {
  await startLongRun(page);
  await page.route(/dry_run/, () => undefined); // no response
  const asked = page.waitForRequest(/dry_run/);
  await page.click("#run");
  await asked;
  const given = page.waitForEvent("requestfailed", request => request.url().includes("dry_run"));
  await page.click("#cancel");
  await given;
  await expect(page.locator("#job")).toHaveText("Cancelled.");
});

test("a run that is left before it has submitted a job submits none", async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  const isCancel = request => request.method() === "DELETE";
  await page.route("**/v1/jobs/*", async route => {
    if (isCancel(route.request())) await held;
    await route.continue();
  });
  await startLongRun(page);
  const asked = page.waitForRequest(isCancel);
  await page.click("#run"); // waits until the job before it is cancelled
  await asked;
  const sent = [];
  page.on("request", request => {
    if (request.method() === "POST") sent.push(request.url());
  });
  await page.click("#new");
  const came = page.waitForResponse(response => isCancel(response.request()));
  release();
  await came;
  // Another response: the run has ended by then.
  await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
  expect(sent).toEqual([]);
});

/** The share of the view that differs from a screenshot, by areas: the fineness of a frame is none. */
async function differing(page, before) {
  const now = await page.locator("#view").screenshot();
  return await page.evaluate(
    async texts => {
      const [a, b] = await Promise.all(
        texts.map(async text => {
          const image = await createImageBitmap(
            new Blob([Uint8Array.from(atob(text), c => c.charCodeAt(0))]),
            { resizeWidth: 64, resizeHeight: 64, resizeQuality: "high" },
          );
          const context = new OffscreenCanvas(64, 64).getContext("2d");
          context.drawImage(image, 0, 0);
          return context.getImageData(0, 0, 64, 64).data;
        }),
      );
      return a.filter((value, i) => Math.abs(value - b[i]) > 40).length / a.length;
    },
    [before, now].map(shot => shot.toString("base64")),
  );
}

/** The camera, as the page asks the daemon for a turntable of the view. */
async function cameraOf(page) {
  let options;
  const path = "**/v1/jobs";
  await page.route(path, async route => {
    ({ options } = route.request().postDataJSON());
    await route.fulfill({ status: 400, json: { code: "test", detail: "not drawn" } });
  });
  await page.click('button:text-is("Turntable GIF")');
  await page.click("#banner button");
  await page.unroute(path);
  await page.evaluate(() => (document.getElementById("status").textContent = ""));
  const { azimuth, elevation, zoom } = options;
  return { azimuth, elevation, zoom };
}

test("the view turns by keys, is cut by a section and keeps its camera", DRAWN, async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Knot")');
  await resize(page, 96);
  await shown(page, 96);
  await page.click("#pictures summary");
  const view = page.locator("#view");
  await expect.poll(() => hasPicture(page)).toBe(true);
  expect(await cameraOf(page)).toMatchObject({ azimuth: "30.0", elevation: "20.0" });
  const start = await view.screenshot();
  await page.focus("#canvas");
  for (let i = 0; i < 4; ++i) await page.keyboard.press("ArrowRight");
  await expect.poll(() => differing(page, start)).toBeGreaterThan(0.05);
  const camera = await cameraOf(page);
  await settled(page);
  expect(camera).toMatchObject({ azimuth: "50.0", elevation: "20.0" });
  const whole = await view.screenshot();
  await page.check('#card-look input[value="y"]', { force: true });
  await expect(page.locator("#card-look output")).toHaveText(/^\d+ \/ \d+$/);
  await expect.poll(() => differing(page, whole)).toBeGreaterThan(0.05);
  await page.check('#card-look input[value=""]', { force: true });
  await expect.poll(() => differing(page, whole)).toBeLessThan(0.02);
  await page.check('#card-look input[value="y"]', { force: true });
  await page.selectOption("#card-look select", "clay");
  await resize(page, 64);
  await shown(page, 64);
  await expect(page.locator("#card-look output")).toHaveText(/^\d+ \/ \d+$/);
  await expect.poll(() => differing(page, whole)).toBeGreaterThan(0.05);
  expect(await cameraOf(page)).toEqual(camera);
});

test("without WebGL 2 the daemon draws", async ({ page }) => {
  await page.addInitScript(() => {
    const original = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
      return kind === "webgl2" ? null : original.call(this, kind, ...rest);
    };
  });
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Rocket")');
  await shown(page, 256);
  await expect(page.locator("#picture")).toHaveAttribute("src", /^blob:/);
  await expect(page.locator("#card-look")).toContainText("no WebGL 2");
  await expect.poll(() => hasPicture(page)).toBe(true);
});

test("a picture, a turntable and a link that others can open", async ({ page, request }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Rocket")');
  await resize(page, 32);
  await shown(page, 32);
  await page.click("#pictures summary");
  await page.fill('#pictures input[aria-label="Width"]', "320");
  await page.fill('#pictures input[aria-label="Height"]', "200");
  const png = await download(page, () => page.click("#png"));
  expect([png.name, png.bytes.readUInt32BE(16), png.bytes.readUInt32BE(20)]).toEqual([
    "rocket.png",
    320,
    200,
  ]);
  const gif = await download(page, () => page.click('button:text-is("Turntable GIF")'));
  expect([gif.name, gif.bytes.subarray(0, 6).toString()]).toEqual(["rocket.gif", "GIF89a"]);
  await page.selectOption("#format", "vox");
  await page.click('button:text-is("Share link")');
  const link = page.locator('input[aria-label="Share link"]');
  await expect(link).toHaveValue(/\/v1\/jobs\/.*signature=/);
  const shared = await request.get(await link.inputValue());
  expect([shared.status(), (await shared.body()).subarray(0, 4).toString()]).toEqual([200, "VOX "]);
  expect(shared.headers()["content-disposition"]).toContain('"rocket.vox"');
});

test("a link that comes after another result is not shown", async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route(/\/share\?/, async route => {
    await held;
    await route.continue();
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 32);
  await shown(page, 32);
  await expect(page.locator("#commands pre")).toContainText("size=32");
  const asked = page.waitForRequest(/\/share\?/);
  await page.click('button:text-is("Share link")');
  await asked;
  await resize(page, 40);
  await expect(page.locator("#commands pre")).toContainText("size=40"); // the result to take
  const came = page.waitForResponse(/\/share\?/);
  release();
  await came;
  // Another response: the page has read the link by then.
  await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
  await expect(page.locator('input[aria-label="Share link"]')).toBeHidden();
});

test("delete removes the mesh and its results", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "concave.obj"));
  await shown(page, 256);
  const { assets } = await daemon.json("/v1/assets");
  const asset = assets.find(one => one.filename === "concave.obj");
  const results = async () => (await daemon.json("/v1/results")).results.map(one => one.filename);
  expect(await results()).toContain("concave.voxg");
  await page.click("#delete");
  await told(page, "concave and its results are deleted");
  await expect(page.locator("#start")).toBeVisible();
  expect((await fetch(`${daemon.url}/v1/assets/${asset.id}?brief=1`)).status).toBe(410);
  expect(await results()).not.toContain("concave.voxg");
});

test("delete waits until the job that runs is cancelled", async ({ page }) => {
  await startLongRun(page);
  const steps = [];
  await page.route("**/v1/**", async route => {
    const request = route.request();
    if (request.method() !== "DELETE") return await route.continue();
    if (!request.url().includes("ended=keep")) {
      steps.push("delete");
      return await route.continue();
    }
    const response = await route.fetch();
    // Another response: a page that does not wait has asked for more by then.
    await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
    steps.push("cancelled");
    await route.fulfill({ response });
  });
  await page.click("#delete");
  await told(page, "sample and its results are deleted");
  expect(steps.slice(0, 2)).toEqual(["cancelled", "delete"]);
});

test("delete cancels an export that runs, and waits for it", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#card-take")).toContainText("about"); // the result to take
  const job = { id: "export", kind: "export", state: "running" }; // it has no events
  const steps = [];
  await page.route("**/v1/jobs", route => route.fulfill({ json: job }));
  await page.route("**/v1/jobs/export/events", () => undefined);
  await page.route("**/v1/**", async route => {
    const request = route.request();
    if (request.method() !== "DELETE") return await route.fallback();
    if (!request.url().includes("ended=keep")) {
      steps.push("delete");
      return await route.continue();
    }
    // Another response: a page that does not wait has asked for more by then.
    await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
    steps.push("cancelled");
    await route.fulfill({ json: { ...job, state: "cancelled" } });
  });
  const asked = page.waitForRequest("**/v1/jobs/export/events");
  await page.click("#card-take button.primary");
  await asked;
  await page.click("#delete");
  await told(page, "sample and its results are deleted");
  expect(steps.slice(0, 2)).toEqual(["cancelled", "delete"]);
  await expect(page.locator("#banner")).toBeHidden();
});

test("an error says what was expected and what came", async ({ page }) => {
  await page.goto(daemon.url);
  const [bad] = JSON.parse(readFileSync(join(fixtures, "bad/list.json")));
  await drop(page, join(fixtures, "bad", bad.file));
  const banner = page.locator("#banner");
  await expect(banner).toBeVisible();
  await expect(banner).toContainText(bad.message);
  await expect(banner).toContainText(/expected .+got .+/);
  await expect(banner).toHaveAttribute("role", "alert");
  await banner.getByRole("button").click();
  await expect(banner).toBeHidden();
});

test("two tabs work beside each other", async ({ page, context }) => {
  const other = await context.newPage();
  await Promise.all([page.goto(daemon.url), other.goto(daemon.url)]);
  await Promise.all([
    page.click('.sample:has-text("Rocket")'),
    other.click('.sample:has-text("Knot")'),
  ]);
  await Promise.all([shown(page, 256), shown(other, 256)]);
  await other.close();
});

test("after a restart of the daemon the page goes on", async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Knot")');
  await shown(page, 256);
  await daemon.stop("SIGKILL");
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  await daemon.start();
  await shown(page, 96);
  await expect(page.locator("#offline")).toBeHidden();
  await expect(page.locator("#banner")).toBeHidden();
});

test("after 40 s without the daemon the page goes on", async ({ page }) => {
  // Waits are 50 times shorter. The page tries again after 0.4, 0.8, 1.5 and then every 2.5 s.
  await page.addInitScript(() => {
    const original = window.setTimeout;
    window.setTimeout = (call, ms, ...given) => original(call, ms >= 400 ? ms / 50 : ms, ...given);
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  let tries = 0,
    isAway = true;
  await page.route("**/v1/**", route => {
    ++tries;
    return isAway ? route.abort() : route.continue();
  });
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  await expect.poll(() => tries).toBeGreaterThan(18); // 40 s
  isAway = false;
  await shown(page, 96);
  await expect(page.locator("#offline")).toBeHidden();
  await expect(page.locator("#banner")).toBeHidden();
});

test("a problem that comes while the daemon is away stays when it is back", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  let isAway = true;
  await page.route("**/v1/**", route => (isAway ? route.abort() : route.continue()));
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  const banner = page.locator("#banner");
  await drop(page, join(fixtures, "bad/list.json"));
  await expect(banner).toContainText("None of these files is a mesh: list.json");
  isAway = false;
  await told(page, "The daemon answers again");
  await expect(banner).toContainText("None of these files is a mesh: list.json");
  await expect(banner).toBeVisible();
});

test("a problem stays while the daemon is away and when it is back", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await drop(page, join(fixtures, "bad/list.json"));
  const banner = page.locator("#banner"),
    text = "None of these files is a mesh: list.json";
  await expect(banner).toContainText(text);
  let isAway = true;
  await page.route("**/v1/**", route => (isAway ? route.abort() : route.continue()));
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  await expect(banner).toContainText(text);
  isAway = false;
  await shown(page, 96);
  await expect(page.locator("#offline")).toBeHidden();
  await expect(banner).toContainText(text);
  await expect(banner).toBeVisible();
});

test("a body that breaks off is asked for again", async ({ page }) => {
  let grids = 0;
  const proxy = http.createServer((request, response) => {
    const { method, headers, url } = request;
    const forwarded = http.request(daemon.url + url, { method, headers }, answer => {
      response.writeHead(answer.statusCode, answer.headers);
      if (!url.startsWith("/v1/grids/") || ++grids > 1) answer.pipe(response);
      else answer.once("data", () => response.write("VOXGRID", () => response.destroy()));
    });
    request.pipe(forwarded);
  });
  await new Promise(resolve => proxy.listen(0, "127.0.0.1", resolve));
  await page.goto(`http://127.0.0.1:${proxy.address().port}`);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  expect(grids).toBe(2);
  await expect(page.locator("#banner")).toBeHidden();
  proxy.close();
});

test("a clock that is five minutes late does not change what is told", async ({ page }) => {
  await page.addInitScript(() => {
    const now = Date.now;
    Date.now = () => now() - 300_000;
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 300);
  await expect(page.locator("#price")).toContainText("starts at once");
});

test("the daemon draws once the context is lost for good", async ({ page }) => {
  // A wait for the browser to give the context back ends at once.
  await page.addInitScript(() => {
    const original = window.setTimeout;
    window.setTimeout = (call, ms, ...given) => original(call, ms === 10_000 ? 0 : ms, ...given);
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#card-look").getByLabel("Show", { exact: true })).toBeVisible();
  expect(page.workers()).toHaveLength(1);
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/v1/grids/*", async route => {
    await held;
    await route.continue();
  });
  const asked = page.waitForRequest("**/v1/grids/*");
  await resize(page, 64);
  const url = (await asked).url();
  await page.focus("#canvas");
  await page.evaluate(() => {
    document.getElementById("canvas").getContext("webgl2").getExtension("WEBGL_lose_context").loseContext();
  });
  await expect(page.locator("#picture")).toHaveAttribute("src", /^blob:/);
  await expect(page.locator("#card-look").getByLabel("Show", { exact: true })).toBeHidden();
  await expect(page.locator("#view")).toBeFocused();
  await expect.poll(() => page.workers().length).toBe(0);
  // The grid that comes now has no viewer any more.
  const drawn = page.waitForRequest(request => request.url().startsWith(`${url}/render.png`));
  release();
  await drawn;
});

test("a page of another origin can neither post nor read", async ({ page }) => {
  const foreign = http.createServer((_, response) =>
    response.setHeader("Content-Type", "text/html").end("<p>elsewhere"),
  );
  await new Promise(resolve => foreign.listen(0, "127.0.0.1", resolve));
  await page.goto(`http://localhost:${foreign.address().port}/`);
  const before = (await daemon.json("/v1/assets")).assets.length;
  const outcome = await page.evaluate(async url => {
    const results = [];
    for (const mode of ["cors", "no-cors"]) {
      try {
        const response = await fetch(`${url}/v1/assets?filename=evil.obj`, {
          method: "POST",
          mode,
          body: "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        });
        results.push(response.status);
      } catch {
        results.push("refused");
      }
    }
    return results;
  }, daemon.url);
  expect(outcome[0]).toBe("refused");
  expect((await daemon.json("/v1/assets")).assets.length).toBe(before);
  foreign.close();
});

test("no serious findings of axe-core: start, voxels, activity, light and dark", async ({
  page,
}) => {
  const check = async () => {
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
      expect(await seriousFindings(page), colorScheme).toEqual([]);
    }
  };
  await page.goto(daemon.url);
  await check();
  await page.click('.sample:has-text("Worm")');
  await shown(page, 128);
  for (const summary of await page.locator("#panel summary").all()) await summary.click();
  await check();
  await page.goto(`${daemon.url}/admin`);
  await expect(page.locator("#admin")).toContainText("worm.glb");
  await expect(page.locator("#admin")).toContainText(/Memory.* MB.* of all tenants; .*B of .*B free/s);
  await check();
});

test("a phone's width needs no sideways scrolling, and all works by keyboard", async ({ page }) => {
  await page.setViewportSize({ width: 360, height: 740 });
  await page.goto(daemon.url);
  await page.focus('.sample:has-text("Rocket")');
  await page.keyboard.press("Enter");
  await shown(page, 256);
  await expect(page.locator("#view")).toBeFocused();
  for (const summary of await page.locator("#panel summary").all()) await summary.click();
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(360);
  await page.focus("#size-slider");
  await page.keyboard.press("ArrowLeft");
  await expect(page.locator("#size")).toHaveValue("128");
  await shown(page, 128);
  await expect(page.locator("#size-slider")).toBeFocused();
  const price = await page.textContent("#price");
  await page.keyboard.press("End"); // a job that waits for a click
  await expect(page.locator("#price")).not.toHaveText(price);
  await expect(page.locator("#size-slider")).toBeFocused();
  await page.focus("#new");
  await page.keyboard.press("Enter");
  await expect(page.locator("#files")).toBeFocused();
  await page.goto(`${daemon.url}/admin`);
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(360);
  const queue = () => page.waitForResponse(response => response.url().includes("/v1/queue"));
  const devices = page.locator("#admin .scroll").first();
  await devices.focus();
  for (let i = 0; i < 3; ++i) await queue(); // one may be under way, and one is shown for sure
  await expect(devices).toBeFocused();
});

test.describe("with keys", () => {
  let locked, key;
  test.beforeAll(async () => {
    locked = new Daemon();
    key = locked.keys("add", "lab");
    await locked.start();
  });
  test.afterAll(() => locked?.end());

  const giveKey = async (page, text) => {
    await page.fill("#key", text);
    await page.keyboard.press("Enter");
  };

  const statusOf = async text =>
    (await fetch(`${locked.url}/v1/me`, { headers: { Authorization: `Bearer ${text}` } })).status;

  test("a key is asked for, kept for the tab if wished, and never in a URL", async ({ page }) => {
    const urls = [];
    page.on("request", request => urls.push(request.url()));
    await page.goto(locked.url);
    await giveKey(page, "vxk_wrong");
    await expect(page.locator("dialog")).toContainText("does not take this key");
    await page.check("dialog input[type=checkbox]");
    await giveKey(page, key);
    await expect(page.locator("dialog")).toBeHidden();
    await expect(page.locator("#keys")).toHaveText("Key of lab");
    await page.click('.sample:has-text("Rocket")');
    await shown(page, 256);
    await page.reload();
    await expect(page.locator("#keys")).toHaveText("Key of lab");
    await page.click("#keys"); // forgets it
    await expect(page.locator("dialog")).toBeVisible();
    expect(await page.evaluate(() => ({ ...sessionStorage, ...localStorage }))).toEqual({});
    expect(urls.filter(url => url.includes(key))).toEqual([]);
  });

  test("without a key the dialog stays, and a key that no header takes is refused", async ({
    page,
  }) => {
    await page.addInitScript(() => {
      if (!window.name) sessionStorage.setItem("voxeld-key", "schlüssel");
      window.name = "visited";
    });
    await page.goto(locked.url);
    const input = page.locator("#key");
    for (let i = 0; i < 3; ++i) {
      await expect(input).toBeFocused();
      await page.keyboard.press("Escape");
    }
    await expect(input).toBeFocused();
    expect(await page.evaluate(() => sessionStorage.length)).toBe(0);
    await giveKey(page, "schlüssel");
    expect(await input.evaluate(element => element.validationMessage)).toContain("ASCII");
    await expect(page.locator("#banner")).toBeHidden();
    await giveKey(page, key);
    await expect(page.locator("#keys")).toHaveText("Key of lab");
  });

  test("a key that is revoked meanwhile is asked for anew, and the work goes on", async ({
    page,
  }) => {
    const brief = locked.keys("add", "brief");
    await page.goto(locked.url);
    await giveKey(page, brief);
    await page.click('.sample:has-text("Knot")');
    await shown(page, 256);
    locked.keys("revoke", brief.split("_")[1]);
    await expect.poll(() => statusOf(brief)).toBe(401); // the daemon has read its keys again
    const next = locked.keys("add", "brief");
    await expect.poll(() => statusOf(next)).toBe(200);
    await resize(page, 80);
    await expect(page.locator("dialog")).toContainText("revoked");
    await giveKey(page, next);
    await shown(page, 80);
  });

  test("a tenant sees its own jobs and storage, an admin all", async ({ page }) => {
    const stored = await fetch(`${locked.url}/v1/assets?filename=own.ply`, {
      method: "POST",
      headers: { Authorization: `Bearer ${key}` },
      body: readFileSync(join(fixtures, "sample.ply")),
    });
    expect(stored.ok).toBe(true);
    await page.goto(`${locked.url}/admin`);
    await giveKey(page, locked.keys("add", "other"));
    await expect(page.locator("#admin")).toContainText("your own jobs and storage");
    await expect(page.locator("#admin")).not.toContainText("own.ply");
    await page.reload();
    await giveKey(page, locked.keys("add", "boss", "--admin"));
    await expect(page.locator("#admin")).toContainText("every tenant");
    await expect(page.locator("#admin")).toContainText("own.ply");
    await page.click('button[aria-label="Delete: own.ply"]');
    await told(page, "own.ply and its results are deleted");
    await expect(page.locator('button[aria-label="Delete: own.ply"]')).toHaveCount(0);
    await expect(page.locator('h2:text-is("Storage")')).toBeFocused();
  });

  test("an admin adds a key that is shown once, and revokes it; a tenant sees no keys", async ({
    page,
  }) => {
    await page.goto(`${locked.url}/admin`);
    await giveKey(page, locked.keys("add", "plain"));
    await expect(page.locator("#admin")).toContainText("your own jobs and storage");
    const card = page.locator('section:has(h2:text-is("Keys"))');
    await expect(card).toBeHidden();
    await page.reload();
    await giveKey(page, locked.keys("add", "head", "--admin"));
    await card.getByLabel("Name", { exact: true }).fill("guest");
    await card.getByLabel("Expires").fill("soon");
    await page.keyboard.press("Enter");
    await expect(page.locator("#banner")).toContainText("30d");
    await card.getByLabel("Expires").fill("30d");
    await card.getByLabel("Requests").fill("10/s");
    await card.getByLabel("Stored bytes").fill("20000000");
    await card.getByRole("button", { name: "Add", exact: true }).click();
    const shownKey = card.getByLabel("Key, shown only now");
    await expect(shownKey).toHaveValue(/^vxk_[a-z2-7]{8}_[a-z2-7]{52}$/);
    await expect(shownKey).toBeFocused();
    const added = await shownKey.inputValue();
    expect(await statusOf(added)).toBe(200);
    const row = card.locator(`tr:has-text("guest ${added.split("_")[1]}")`);
    await expect(row).toContainText(/Tenant.*Stored bytes: 20.*Requests a minute: 600.*live/);
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
      expect(await seriousFindings(page), colorScheme).toEqual([]);
    }
    // A key whose response is lost is not made twice.
    const posts = [];
    const isPost = request => request.method() === "POST";
    await page.route("**/v1/keys", async route => {
      if (!isPost(route.request())) return await route.continue();
      posts.push(await route.fetch());
      await route.abort("connectionreset");
    });
    await card.getByLabel("Name", { exact: true }).fill("lost");
    const lost = page.waitForEvent("requestfailed", isPost);
    await card.getByRole("button", { name: "Add", exact: true }).click();
    await lost;
    await expect(page.locator("#banner")).not.toContainText("30d"); // that of the first error
    await page.unroute("**/v1/keys");
    expect(posts.map(response => response.status())).toEqual([201]);
    await row.getByRole("button", { name: "Revoke" }).click();
    await expect(row).toContainText("revoked");
    await expect(row.getByRole("button")).toHaveCount(0);
    await expect(card.locator("h2")).toBeFocused();
    expect(await statusOf(added)).toBe(401);
  });
});
