// The controls of the voxels: size, fill, colour, and more options folded; and what they cost.
import { field, fill, h, segments, select, setChoices, setSegment, type Choice } from "./dom";
import type { AssetDescription, DryRun } from "./model";
import type { Options } from "./runner";
import { bytesText, duration, t } from "./texts";

const SIZES = [16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384];
const SIZE_MAX = 16384;
const DEFAULTS: Options = {
  size: 256,
  fill: "surface",
  color: "average",
  rule: "touch",
  up: "y",
  padding: 0,
  sign: "auto",
  interior: "none",
  labels: "mesh",
};
const CHANNELS = ["color", "normal", "material", "label", "distance", "coverage"] as const;

const words = (values: readonly string[]): Choice[] =>
  values.map(value => ({ value, text: value }));

export class Settings {
  /** After a change; `isFinal`: not while a slider is dragged. */
  onChange: (isFinal: boolean) => void = () => undefined;

  #values: Record<string, string | number> = { ...DEFAULTS } as Record<string, string | number>;
  #channels = new Set<string>();
  #isSized = false; // by hand
  readonly #slider = h("input", {
    type: "range",
    min: "0",
    max: String(SIZES.length - 1),
    step: "1",
  });
  readonly #number = h("input", {
    type: "number",
    min: "1",
    max: String(SIZE_MAX),
    inputMode: "numeric",
  });
  readonly #fills: HTMLFieldSetElement;
  readonly #note = h("p", { className: "note", hidden: true });
  readonly #thickness: HTMLElement;
  readonly #animations = h("select");
  readonly #fps = h("input", { type: "number", min: "0.01", max: "1000", step: "any" });
  readonly #animationFields: HTMLElement;
  #description: AssetDescription | null = null;

  constructor(parent: HTMLElement) {
    this.#fills = segments(
      t("fill"),
      [
        { value: "surface", text: t("surface") },
        { value: "solid", text: t("solid") },
        { value: "shell", text: t("shell") },
        { value: "band", text: t("band") },
      ],
      "surface",
      value => this.#set("fill", value),
    );
    this.#thickness = field(t("thickness"), this.#numberInput("thickness", 1, 256, "1"));
    this.#thickness.hidden = true;
    this.#animationFields = h(
      "div",
      { className: "stack", hidden: true },
      field(t("animation"), this.#animations),
      field(t("fps"), this.#fps),
    );
    this.#animations.addEventListener("change", () =>
      this.#set("animation", this.#animations.value),
    );
    this.#fps.addEventListener("change", () => this.#set("fps", this.#fps.value));
    parent.append(
      this.#sizeField(),
      this.#animationFields,
      this.#fills,
      this.#note,
      this.#thickness,
      this.#colorField(),
      this.#moreFields(),
    );
    this.#showSize();
  }

  /** The options that differ from the daemon's defaults, and the size. */
  get options(): Options {
    const options: Record<string, string | number | string[]> = {};
    for (const [name, value] of Object.entries(this.#values)) {
      if (value !== "" && (name === "size" || DEFAULTS[name] !== value)) options[name] = value;
    }
    const kind = this.#values["fill"];
    if (kind === "surface") {
      delete options["interior"];
      if (!this.#channels.has("distance")) delete options["sign"];
    }
    if (kind !== "shell" && kind !== "band") delete options["thickness"];
    if (kind === "band") for (const name of ["rule", "interior"]) delete options[name];
    if (!this.#channels.has("label")) delete options["labels"];
    if (options["animation"] === undefined) delete options["fps"];
    if (this.#channels.size > 0)
      options["channels"] = CHANNELS.filter(name => this.#channels.has(name));
    return options;
  }

  /** Offers what fits the mesh. */
  describe(description: AssetDescription): void {
    this.#description = description;
    const usable = (description.animations ?? [])
      .map((animation, index) => ({ animation, index }))
      .filter(({ animation }) => !animation.unusable);
    setChoices(
      this.#animations,
      [
        { value: "", text: t("animationNone") },
        ...usable.map(({ animation, index }) => ({
          value: String(index),
          text: `${animation.name || index} (${duration(animation.duration_s)})`,
        })),
      ],
      usable[0] ? String(usable[0].index) : "",
    );
    this.#animationFields.hidden = usable.length === 0;
    this.#values["animation"] = this.#animations.value;
    this.#values["fps"] = this.#fps.value = usable[0]?.animation.frame_rate
      ? String(usable[0].animation.frame_rate)
      : usable[0]
        ? "24"
        : "";
    if (usable.length > 0 && !this.#isSized) this.#values["size"] = 128; // there is one grid for each frame
    this.#showSize();
    this.#showNote();
  }

  #set(name: string, value: string | number, isFinal = true): void {
    this.#values[name] = value;
    this.#thickness.hidden = this.#values["fill"] !== "shell" && this.#values["fill"] !== "band";
    this.#showNote();
    this.onChange(isFinal);
  }

  #showNote(): void {
    const isOpen = this.#description?.watertight === false;
    this.#note.hidden = !(
      isOpen &&
      (this.#values["fill"] === "solid" || this.#values["fill"] === "shell")
    );
    this.#note.textContent = t("solidNote");
  }

  #showSize(): void {
    const size = Number(this.#values["size"]);
    this.#number.value = String(size);
    const nearest = SIZES.reduce(
      (best, one, i) =>
        Math.abs(Math.log2(one / size)) < Math.abs(Math.log2((SIZES[best] as number) / size))
          ? i
          : best,
      0,
    );
    this.#slider.value = String(nearest);
    this.#slider.setAttribute("aria-valuetext", `${size} ${t("sizeUnit")}`);
  }

  #sizeField(): HTMLElement {
    const slide = (isFinal: boolean) => {
      this.#values["size"] = SIZES[Number(this.#slider.value)] as number;
      this.#isSized = true;
      this.#showSize();
      this.onChange(isFinal);
    };
    this.#slider.addEventListener("input", () => slide(false));
    this.#slider.addEventListener("change", () => slide(true));
    this.#number.addEventListener("change", () => {
      this.#values["size"] = Math.max(
        1,
        Math.min(SIZE_MAX, Math.round(Number(this.#number.value)) || 128),
      );
      this.#isSized = true;
      this.#showSize();
      this.onChange(true);
    });
    this.#slider.id = "size-slider";
    this.#number.id = "size";
    this.#slider.setAttribute("aria-label", t("size"));
    return h(
      "div",
      { className: "size" },
      h("label", { htmlFor: "size" }, t("size")),
      this.#number,
      this.#slider,
      h("small", {}, t("sizeUnit")),
    );
  }

  #colorField(): HTMLElement {
    return field(
      t("color"),
      select(
        [
          { value: "average", text: t("colorAverage") },
          { value: "nearest", text: t("colorNearest") },
          { value: "dominant", text: t("colorDominant") },
          { value: "shaded", text: t("colorShaded") },
          { value: "axis", text: t("colorAxis") },
          { value: "none", text: t("colorNone") },
        ],
        "average",
        value => this.#set("color", value),
      ),
    );
  }

  #numberInput(name: string, min: number, max: number, value: string): HTMLInputElement {
    return h("input", {
      type: "number",
      min: String(min),
      max: String(max),
      value,
      onchange: (event: Event) => this.#set(name, Number((event.target as HTMLInputElement).value)),
    });
  }

  #moreFields(): HTMLElement {
    const channel = (name: string) =>
      h(
        "label",
        { className: "check" },
        h("input", {
          type: "checkbox",
          onchange: (event: Event) => {
            if ((event.target as HTMLInputElement).checked) this.#channels.add(name);
            else this.#channels.delete(name);
            this.onChange(true);
          },
        }),
        t(`channel_${name}` as "channel_color"),
      );
    const choose = (name: string, choices: readonly Choice[]) =>
      select(choices, String(DEFAULTS[name]), value => this.#set(name, value));
    return h(
      "details",
      {},
      h("summary", {}, t("more")),
      field(
        t("rule"),
        choose("rule", [
          { value: "touch", text: t("ruleTouch") },
          { value: "thin", text: t("ruleThin") },
          { value: "center", text: t("ruleCenter") },
        ]),
      ),
      field(t("up"), choose("up", words(["y", "z"]))),
      field(t("padding"), this.#numberInput("padding", 0, 512, "0")),
      field(
        t("sign"),
        choose("sign", words(["auto", "parity", "nonzero", "majority", "flood", "winding"])),
      ),
      field(
        t("interior"),
        choose("interior", [
          { value: "none", text: t("interiorNone") },
          { value: "nearest", text: t("interiorNearest") },
        ]),
      ),
      h(
        "fieldset",
        { className: "checks" },
        h("legend", {}, t("channels")),
        ...CHANNELS.map(channel),
      ),
      field(t("labels"), choose("labels", words(["mesh", "node", "material", "group"]))),
    );
  }

  /** Back to the defaults, for the next mesh. */
  reset(): void {
    this.#values["fill"] = "surface";
    if (!this.#isSized) this.#values["size"] = DEFAULTS["size"] as number;
    this.#description = null;
    this.#values["animation"] = this.#values["fps"] = "";
    this.#animationFields.hidden = true;
    this.#showSize();
    setSegment(this.#fills, "surface");
    this.#thickness.hidden = true;
  }
}

/** The price of a dry run as one line. */
export function priceText(price: DryRun): string {
  if (price.cached) return t("priceCached");
  const {
    seconds_low: low,
    seconds_high: high,
    host_bytes: memory,
    result_bytes: bytes,
  } = price.estimate;
  const seconds =
    duration(low) === duration(high)
      ? duration(high)
      : t("between", { low: duration(low), high: duration(high) });
  const wait = (price.expected_start_ms - Date.now()) / 1000;
  return (
    `${t("price", { seconds, memory: bytesText(memory), bytes: bytesText(bytes) })} · ` +
    (wait > 1 ? t("priceWait", { wait: duration(wait) }) : t("priceNow"))
  );
}

/** Shows a price, or nothing. */
export function showPrice(element: HTMLElement, price: DryRun | null): void {
  fill(element, price ? priceText(price) : "");
}
