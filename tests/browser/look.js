// Opens a page in a headless Chromium, takes a picture of its canvas, and prints as
// JSON what was asked of the network, what errors were told, memory and seconds.
//
// node look.js PAGE PICTURE.png VIEW WIDTH HEIGHT: PAGE is a file or an address of this
// machine, VIEW the number of a viewpoint.
const puppeteer = require("puppeteer-core");
const { pathToFileURL } = require("url");

const [file, picture, view, width, height] = process.argv.slice(2);
const size = { width: Number(width), height: Number(height) };
const address = /^http:/.test(file) ? file : pathToFileURL(file).href;

function pause(ms) {
  return new Promise((done) => setTimeout(done, ms));
}

(async () => {
  const browser = await puppeteer.launch({
    executablePath: process.env.CHROMIUM || "/usr/bin/chromium",
    protocolTimeout: 600000,
    args: [
      "--no-sandbox",
      "--use-angle=swiftshader",
      "--enable-unsafe-swiftshader",
      "--enable-precise-memory-info",
      "--hide-scrollbars",
    ],
  });
  try {
    const page = await browser.newPage();
    await page.setViewport(size);
    const asked = [];
    const errors = [];
    page.on("request", (request) => {
      const inside = /^(file:|data:|blob:|http:\/\/127\.0\.0\.1[:/])/;
      if (!inside.test(request.url())) asked.push(request.url());
    });
    page.on("pageerror", (error) => errors.push(String(error)));
    page.on("console", (message) => {
      if (message.type() === "error" || /error/i.test(message.text())) {
        errors.push(message.text());
      }
    });
    const start = Date.now();
    await page.goto(address, { waitUntil: "load", timeout: 600000 });
    // Two frames drawn after the scene is there.
    await page.waitForFunction("window.skyIsReady && window.skyIsReady()", {
      timeout: 600000,
      polling: 250,
    });
    const seconds = (Date.now() - start) / 1000;
    await page.evaluate((n) => window.showView(n), Number(view));
    await pause(Number(process.env.PAUSE || 4000));
    await page.addStyleTag({
      content: "#about, #views, .x3dom-progress { display: none !important }",
    });
    const { JSHeapUsedSize } = await page.metrics();
    await page.screenshot({ path: picture });
    console.log(
      JSON.stringify({ asked, errors, seconds, heap_mb: JSHeapUsedSize / 1e6 })
    );
  } finally {
    await browser.close();
  }
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
