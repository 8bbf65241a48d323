// Chromium of Debian without a browser's windows, which take a third of the time. It draws by Mesa on the CPU: `gl-egl`
// takes a quarter of SwiftShader's time.
import { defineConfig } from "@playwright/test";

export default defineConfig({
  testMatch: "*.spec.mjs",
  forbidOnly: true, // a test.only that is left over would end the others unseen
  workers: 2, // browsers, with a daemon each and a context for each test
  // These only end a test that hangs, however busy the machine is.
  timeout: 900_000,
  expect: { timeout: 300_000 },
  reporter: "list",
  outputDir: "results",
  use: {
    contextOptions: { reducedMotion: "reduce" },
    viewport: { width: 880, height: 520 },
    launchOptions: {
      executablePath: "/usr/bin/chromium-headless-shell",
      args: [
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--use-angle=gl-egl",
        "--ignore-gpu-blocklist",
        "--disable-gpu-compositing", // WebGL alone is drawn by Mesa: the rest of a page takes longer there
        "--disable-gpu-watchdog", // it ends a process that compiles shaders for long
        "--js-flags=--single-threaded", // V8's own threads: a tenth of all time, with two browsers on two cores
      ],
    },
  },
});
