// Commands that reproduce a result: curl, command line, Python, C++.
import { isSequence, type Options } from "./runner";

/** A result as the page has made it. */
export interface Recipe {
  readonly origin: string; // "http://localhost:8080"
  readonly hasKey: boolean;
  readonly file: string; // name of the mesh
  readonly others: readonly string[]; // names of the files beside it
  readonly options: Options; // of the voxels
  readonly output: Options; // format and its options
  readonly target: string; // name of the output
}

/** A word of a POSIX shell. */
function quoted(text: string): string {
  return /^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

/** A string literal of Python and of C++. */
function literal(text: string): string {
  return JSON.stringify(text);
}

function textOf(value: Options[string]): string {
  return typeof value === "object" ? value.join(",") : String(value);
}

/** Files to name: the CLI and Python find those of folders below that of the mesh. */
function named({ file, others }: Recipe): string[] {
  return [file, ...others.filter(name => file.includes("/") || !name.includes("/"))];
}

function all(recipe: Recipe): [string, Options[string]][] {
  return [...Object.entries(recipe.options), ...Object.entries(recipe.output)] as [
    string,
    Options[string],
  ][];
}

export function curlCommand(recipe: Recipe): string {
  const key = recipe.hasKey ? ' -H "Authorization: Bearer $VOXELD_KEY"' : "";
  const query = (pairs: readonly (readonly [string, string])[]) =>
    String(new URLSearchParams(pairs.map(([name, value]) => [name, value])));
  const options = all(recipe).map(([name, value]) => [name, textOf(value)] as const);
  if (recipe.others.length === 0) {
    const url = `${recipe.origin}/v1/voxelize?${query([["filename", recipe.file], ...options])}`;
    return `curl -fS${key} --data-binary @${quoted(recipe.file)} '${url}' -o ${quoted(recipe.target)}`;
  }
  // A bundle's files one by one, then a manifest that names them.
  const lines = [
    `url=${recipe.origin}`,
    "encoded() { jq -rn --arg n \"${1##*/}\" '$n|@uri'; }",
    `put() { curl -fsS${key} --data-binary @"$1" "$url/v1/assets?filename=$(encoded "$1")" | jq -r .id; }`,
    "files=''",
    `for name in ${[recipe.file, ...recipe.others].map(quoted).join(" ")}; do`,
    '  files="$files,$(jq -cn --arg n "$name" --arg a "$(put "$name")" \'{name: $n, asset: $a}\')"',
    "done",
    `bundle=$(curl -fsS${key} -H 'Content-Type: application/vnd.voxeld.bundle+json' \\`,
    '  -d "{\\"files\\":[${files#,}]}" "$url/v1/assets" | jq -r .id)',
    `curl -fS${key} -X POST "$url/v1/voxelize?asset=$bundle&${query(options)}" -o ${quoted(recipe.target)}`,
  ];
  return lines.join("\n");
}

export function cliCommand(recipe: Recipe): string {
  const flags = all(recipe).map(
    ([name, value]) => `--${name.replaceAll("_", "-")} ${quoted(textOf(value))}`,
  );
  return `VOXELD_URL=${quoted(recipe.origin)} voxel ${named(recipe).map(quoted).join(" ")} ${flags.join(" ")} -o ${quoted(recipe.target)}`;
}

export function pythonCode(recipe: Recipe): string {
  const value = (of: Options[string]) =>
    typeof of === "number"
      ? String(of)
      : typeof of === "object"
        ? JSON.stringify(of)
        : /^(0|[1-9]\d*)(\.\d+)?$/.test(of)
          ? of
          : literal(of);
  const pairs = (options: Options) =>
    Object.entries(options)
      .map(([name, of]) => `, ${name}=${value(of)}`)
      .join("");
  // The target's extension tells the format, but for an archive of frames.
  const { format, ...others } = recipe.output;
  const output = pairs(recipe.target.endsWith(".zip") ? recipe.output : others);
  const [call, result] = isSequence(recipe.options)
    ? ["animate", "animation"]
    : ["voxelize", "grid"];
  const files = named(recipe).map(literal).join(", ");
  const mesh = recipe.others.length === 0 ? files : `[${files}]`;
  const key = recipe.hasKey ? ', key=os.environ["VOXELD_KEY"]' : "";
  return (
    `${recipe.hasKey ? "import os\n" : ""}import voxeld\n\n` +
    `with voxeld.Client(${literal(recipe.origin)}${key}) as client:\n` +
    `    ${result} = client.${call}(${mesh}${pairs(recipe.options)})\n` +
    `    ${result}.save(${literal(recipe.target)}${output})\n`
  );
}

export function cppCode(recipe: Recipe): string {
  const sets = all(recipe)
    .map(([name, value]) => `  options.set(${literal(name)}, ${literal(textOf(value))});\n`)
    .join("");
  const key = recipe.hasKey ? '  settings.key = std::getenv("VOXELD_KEY");\n' : "";
  const files = [recipe.file, ...recipe.others];
  const upload = (name: string) => `client.upload(Source::file(${literal(name)}))`;
  const mesh =
    recipe.others.length === 0
      ? `  const std::string mesh = ${upload(recipe.file)};\n`
      : "  const std::vector<voxeld::client::BundleFile> files = {\n" +
        files.map(name => `      {${literal(name)}, ${upload(name)}},\n`).join("") +
        "  };\n" +
        "  const std::string mesh = client.bundle(files);\n";
  return (
    "#include <voxeld/client.h>\n\n" +
    "#include <cstdio>\n" +
    (recipe.hasKey ? "#include <cstdlib>\n" : "") +
    "#include <string>\n#include <vector>\n\n" +
    "int main() {\n  using voxeld::client::Input, voxeld::client::Source;\n" +
    `  voxeld::client::Settings settings;\n  settings.url = ${literal(recipe.origin)};\n${key}` +
    `  voxeld::client::Client client(settings);\n${mesh}` +
    `  voxeld::client::Options options;\n${sets}` +
    `  std::FILE* out = std::fopen(${literal(recipe.target)}, "wb");\n  if (!out) return 1;\n` +
    '  auto job = client.start("voxelize", Input::of_asset(mesh), options);\n' +
    "  job.download([&](std::span<const std::byte> bytes) { std::fwrite(bytes.data(), 1, bytes.size(), out); });\n" +
    "  return std::fclose(out);\n}\n"
  );
}
