// Shared by the tests of the page: the daemon, a page that tells its faults, and a person's steps.
import { readFileSync } from "node:fs";
import { expect, test as base } from "@playwright/test";
import { Daemon, run, temporaryFolder } from "./daemon.mjs";

export { expect };
export const fixtures = temporaryFolder("web-fixtures");
export const daemon = new Daemon();

// A software driver compiles the ray march for seconds in each page and casts some 50 rays for each
// pixel at rest. So pages compile it and draw in tests with this tag alone, and a quarter of the
// pixels.
export const DRAWN = { tag: "@drawn" };
// Rare races and repetitions, which the gate leaves to its long form.
export const LONG = { tag: "@long" };
export const LONG_DRAWN = { tag: [DRAWN.tag, LONG.tag] };

// No test may violate the policy or end a script with an error.
async function watchFaults(page) {
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
}

// Expected seconds do not depend on the machine: a job of at most 256 cells a side starts by
// itself, a larger one waits for a click. The end of the range must not matter.
async function fixEstimates(context) {
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
}

async function limitDraws(context, isDrawn) {
  await context.addInitScript(isDrawn => {
    const gl = WebGL2RenderingContext.prototype;
    if (isDrawn) Object.defineProperty(window, "devicePixelRatio", { get: () => 0.5 });
    else {
      gl.drawArrays = () => undefined;
      const { shaderSource } = gl;
      gl.shaderSource = function (shader, text) {
        const isVertex = text.includes("gl_Position");
        shaderSource.call(this, shader, isVertex ? text : "#version 300 es\nvoid main() {}");
      };
    }
    // All that the viewer calls again and again while it draws.
    window.calls = 0;
    for (const name of ["clientWaitSync", "getProgramParameter"]) {
      const original = gl[name];
      gl[name] = function (...given) {
        ++window.calls;
        return original.apply(this, given);
      };
    }
  }, isDrawn);
}

export const test = base.extend({
  // For the files that a worker runs.
  isServed: [
    async ({}, use) => {
      run("voxeld_make_fixtures", [fixtures]);
      await daemon.start();
      await use(true);
      await daemon.end();
    },
    { scope: "worker", auto: true },
  ],
  page: async ({ page, context }, use, info) => {
    await watchFaults(page);
    await fixEstimates(context);
    await limitDraws(context, info.tags.includes(DRAWN.tag));
    await use(page);
    expect(page.faults).toEqual([]);
    if (page.url().startsWith("http"))
      expect(await page.evaluate(() => window.violations)).toEqual([]);
  },
});

/** Drops files of the disk on the page, as one drag. */
export async function drop(page, ...paths) {
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
export async function shown(page, side) {
  await expect(page.locator("#facts:not([hidden])")).toHaveText(
    new RegExp(`voxels, .*\\b${side}\\b(?!.*Preview)`),
  );
}

/** Waits until the page has told something. */
export async function told(page, text) {
  await expect.poll(() => page.evaluate(() => [...window.notes].join("\n"))).toContain(text);
}

/** Waits until the view draws no more. */
export async function settled(page) {
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
export async function resize(page, size) {
  await expect(page.locator("#card-model")).toContainText("triangles");
  await page.fill("#size", String(size));
  await page.press("#size", "Enter");
}

/** Whether the canvas or picture shows more than one colour. */
export async function hasPicture(page) {
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

export async function download(page, action) {
  const [event] = await Promise.all([page.waitForEvent("download"), action()]);
  return { name: event.suggestedFilename(), bytes: readFileSync(await event.path()) };
}
