// The controls of the voxels: size, fill, colour, and more options folded; and what they cost.
import { field, h, segments, select, setChoices, setSegment, type Choice } from "./dom";
import type { AssetDescription, DryRun } from "./model";
import type { Options } from "./runner";
import { bytesText, duration, names, t, T } from "./texts";

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
  values.map(value => [value, value]);

export class Settings {
  /** After a change; `isFinal`: not while a slider is dragged. */
  declare onChange: (isFinal: boolean) => void;

  #values: Record<string, string | number> = { ...DEFAULTS } as Record<string, string | number>;
  #channels: Set<string> | null = null; // null: the daemon's choice
  readonly #channelBoxes = new Map<string, HTMLInputElement>();
  #isSized = false; // by hand
  readonly #slider = h("input", {
    type: "range",
    id: "size-slider",
    "aria-label": T.size,
    max: SIZES.length - 1,
  });
  readonly #number = h("input", {
    type: "number",
    id: "size",
    min: 1,
    max: SIZE_MAX,
    inputMode: "numeric",
  });
  readonly #fills: HTMLFieldSetElement;
  readonly #note = h("p", { className: "note", hidden: true }, T.solidNote);
  readonly #thickness: HTMLElement;
  readonly #animations = h("select");
  readonly #fps = h("input", { type: "number", min: 0.01, max: 1000, step: "any" });
  readonly #animationFields: HTMLElement;
  #description: AssetDescription | null = null;

  constructor(parent: HTMLElement) {
    this.#fills = segments(
      T.fill,
      [
        ["surface", T.surface],
        ["solid", T.solid],
        ["shell", T.shell],
        ["band", T.band],
      ],
      "surface",
      value => this.#set("fill", value),
    );
    this.#thickness = field(T.thickness, this.#numberInput("thickness", 1, 256, 1));
    this.#thickness.hidden = true;
    this.#animationFields = h(
      "div",
      { className: "stack", hidden: true },
      field(T.animation, this.#animations),
      field(T.fps, this.#fps),
    );
    this.#animations.onchange = () => {
      this.#showRate();
      this.#set("animation", this.#animations.value);
    };
    this.#fps.onchange = () => this.#set("fps", this.#fps.value);
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
    const channels = this.#channels ?? this.#usualChannels;
    for (const [name, value] of Object.entries(this.#values)) {
      if (value !== "" && (name === "size" || DEFAULTS[name] !== value)) options[name] = value;
    }
    const kind = this.#values["fill"];
    if (kind === "surface") {
      delete options["interior"];
      if (!channels.has("distance")) delete options["sign"];
    }
    if (kind !== "shell" && kind !== "band") delete options["thickness"];
    if (kind === "band") for (const name of ["rule", "interior"]) delete options[name];
    if (!channels.has("label")) delete options["labels"];
    if (options["animation"] === undefined) delete options["fps"];
    if (this.#channels)
      options["channels"] = ["occupancy", ...CHANNELS.filter(name => channels.has(name))];
    return options;
  }

  // Those that the daemon gives a grid where a request names none.
  get #usualChannels(): Set<string> {
    const { color, fill } = this.#values;
    const isColored =
      color !== "none" &&
      (this.#description?.has_colors || color === "shaded" || color === "axis");
    return new Set([...(isColored ? ["color"] : []), ...(fill === "band" ? ["distance"] : [])]);
  }
  #showChannels(): void {
    const channels = this.#channels ?? this.#usualChannels;
    for (const [name, box] of this.#channelBoxes) box.checked = channels.has(name);
  }

  /** Offers what fits the mesh. */
  describe(description: AssetDescription): void {
    this.#description = description;
    const animations = description.animations ?? [],
      first = animations.findIndex(({ unusable }) => !unusable),
      hasAny = first >= 0;
    setChoices(
      this.#animations,
      [
        ["", T.animationNone],
        ...animations.flatMap(({ name, duration_s, unusable }, i): Choice[] =>
          unusable ? [] : [[String(i), `${name || i} (${duration(duration_s)})`]],
        ),
      ],
      hasAny ? String(first) : "",
    );
    this.#animationFields.hidden = !hasAny;
    this.#values["animation"] = this.#animations.value;
    this.#showRate();
    if (hasAny && !this.#isSized) this.#values["size"] = 128; // there is one grid for each frame
    this.#showSize();
    this.#showNote();
    this.#showChannels();
  }

  // That of the chosen animation.
  #showRate(): void {
    const { value } = this.#animations;
    this.#values["fps"] = this.#fps.value = value
      ? String(this.#description!.animations![+value]!.frame_rate || 24)
      : "";
  }

  #set(name: string, value: string | number, isFinal = true): void {
    this.#values[name] = value;
    // Until it is chosen, it is the daemon's: of a band more than of a shell.
    const thickness = this.#thickness.querySelector("input") as HTMLInputElement,
      kind = this.#values["fill"];
    thickness.value = String(this.#values["thickness"] || (kind === "band" ? 3 : 1));
    this.#thickness.hidden = kind !== "shell" && kind !== "band";
    this.#showNote();
    this.#showChannels();
    this.onChange(isFinal);
  }

  #showNote(): void {
    const isOpen = this.#description?.watertight === false;
    this.#note.hidden = !isOpen || !["solid", "shell"].includes(String(this.#values["fill"]));
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
    this.#slider.setAttribute("aria-valuetext", `${size} ${T.sizeUnit}`);
  }

  #sizeField(): HTMLElement {
    const slide = (isFinal: boolean) => {
      this.#values["size"] = SIZES[Number(this.#slider.value)] as number;
      this.#isSized = true;
      this.#showSize();
      this.onChange(isFinal);
    };
    this.#slider.oninput = () => slide(false);
    this.#slider.onchange = () => slide(true);
    this.#number.onchange = () => {
      this.#values["size"] = Math.max(
        1,
        Math.min(SIZE_MAX, Math.round(Number(this.#number.value)) || 128),
      );
      this.#isSized = true;
      this.#showSize();
      this.onChange(true);
    };
    return h(
      "div",
      { className: "size" },
      h("label", { htmlFor: "size" }, T.size),
      this.#number,
      this.#slider,
      h("small", {}, T.sizeUnit),
    );
  }

  #colorField(): HTMLElement {
    return field(
      T.color,
      select(
        [
          ["average", T.colorAverage],
          ["nearest", T.colorNearest],
          ["dominant", T.colorDominant],
          ["shaded", T.colorShaded],
          ["axis", T.colorAxis],
          ["none", T.colorNone],
        ],
        "average",
        value => this.#set("color", value),
      ),
    );
  }

  #numberInput(name: string, min: number, max: number, value: number): HTMLInputElement {
    return h("input", {
      type: "number",
      min,
      max,
      value,
      // Empty, or 0: the daemon's.
      onchange: (event: Event) => this.#set(name, Number((event.target as HTMLInputElement).value) || ""),
    });
  }

  #moreFields(): HTMLElement {
    const channel = (name: string) => {
      const box = h("input", {
        type: "checkbox",
        onchange: () => {
          this.#channels ??= this.#usualChannels;
          if (box.checked) this.#channels.add(name);
          else this.#channels.delete(name);
          this.onChange(true);
        },
      });
      this.#channelBoxes.set(name, box);
      return h("label", { className: "check" }, box, names[`channel_${name}`]!);
    };
    const choose = (name: string, choices: readonly Choice[]) =>
      select(choices, String(DEFAULTS[name]), value => this.#set(name, value));
    return h(
      "details",
      {},
      h("summary", {}, T.more),
      field(
        T.rule,
        choose("rule", [
          ["touch", T.ruleTouch],
          ["thin", T.ruleThin],
          ["center", T.ruleCenter],
        ]),
      ),
      field(T.up, choose("up", words(["y", "z"]))),
      field(T.padding, this.#numberInput("padding", 0, 512, 0)),
      field(
        T.sign,
        choose("sign", words(["auto", "parity", "nonzero", "majority", "flood", "winding"])),
      ),
      field(
        T.interior,
        choose("interior", [
          ["none", T.interiorNone],
          ["nearest", T.interiorNearest],
        ]),
      ),
      h(
        "fieldset",
        { className: "checks" },
        h("legend", {}, T.channels),
        ...CHANNELS.map(channel),
      ),
      field(T.labels, choose("labels", words(["mesh", "node", "material", "group"]))),
    );
  }

  /** Back to the defaults, for the next mesh. */
  reset(): void {
    this.#values["fill"] = "surface";
    if (!this.#isSized) this.#values["size"] = DEFAULTS["size"] as number;
    this.#description = null;
    this.#channels = null;
    this.#values["animation"] = this.#values["fps"] = "";
    this.#animationFields.hidden = true;
    this.#showSize();
    setSegment(this.#fills, "surface");
    this.#thickness.hidden = true;
    this.#showChannels();
  }
}

/** The price of a dry run as one line; `now`: milliseconds of the daemon's clock. */
export function priceText(price: DryRun, now: number): string {
  if (price.cached) return T.priceCached;
  const {
    seconds_low: low,
    seconds_high: high,
    host_bytes: memory,
    result_bytes: bytes,
  } = price.estimate;
  const seconds =
    duration(low) === duration(high)
      ? duration(high)
      : t(T.between, { low: duration(low), high: duration(high) });
  const wait = (price.expected_start_ms - now) / 1000;
  return (
    `${t(T.price, { seconds, memory: bytesText(memory), bytes: bytesText(bytes) })} · ` +
    (wait > 1 ? t(T.priceWait, { wait: duration(wait) }) : T.priceNow)
  );
}
