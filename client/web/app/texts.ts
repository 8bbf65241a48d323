// Every text that the page shows, in one table for translation. {name} is replaced by a value.
import type { ErrorBody, JobStatus } from "./model";

export const enum T {
  title = "voxeld",
  tagline = "Meshes to voxels",
  activity = "Activity",
  home = "Voxelize",
  key = "API key",
  dropTitle = "Drop a mesh, watch it become voxels",
  dropHint = "OBJ, PLY, STL, OFF, glTF, GLB, MD5, 3MF, a zip or voxels. With textures and animations: several files or a folder.",
  choose = "Choose files",
  chooseFolder = "Choose a folder",
  samples = "Or try a sample",
  sampleRocketHint = "colours, closed",
  samplePlanetHint = "OBJ with a texture",
  sampleKnotHint = "thin, closed",
  sampleWormHint = "animated",
  goesHere = "Files go to this computer and nowhere else.",
  goesTo = "Files go to {host} and nowhere else.",
  goesPlain = "The connection is not encrypted.",
  newMesh = "New mesh",
  remove = "Delete",
  removed = "{name} and its results are deleted.",
  model = "Model",
  hashing = "Looking whether {name} is here already",
  uploading = "Uploading {name}: {done} of {total}",
  uploadLost = "The upload broke off three times.",
  knownFile = "{name} is here already; nothing is uploaded.",
  triangles = "{n} triangles",
  parts = "{n} parts",
  watertight = "watertight",
  notWatertight = "not watertight ({n} open or branching edges)",
  textures = "{n} textures",
  oneTexture = "1 texture",
  vertexColors = "vertex colours",
  noColors = "no colours",
  animations = "{n} animations",
  oneAnimation = "1 animation",
  missing = "Missing: {names}. Drop these files to add them.",
  ignored = "{n} further meshes were left out; drop one at a time.",
  noMesh = "None of these files is a mesh: {names}.",
  voxels = "Voxels",
  size = "Size",
  sizeUnit = "voxels on the longest side",
  fill = "Fill",
  surface = "Surface",
  solid = "Solid",
  shell = "Shell",
  band = "Band",
  solidNote = "The mesh has holes; the daemon decides what is inside.",
  color = "Colour",
  colorAverage = "Average",
  colorNearest = "Nearest point",
  colorDominant = "Largest material",
  colorShaded = "Light baked in",
  colorAxis = "By direction",
  colorNone = "None",
  more = "More options",
  rule = "Surface rule",
  ruleTouch = "Every touched voxel",
  ruleThin = "Thin",
  ruleCenter = "Centre of columns",
  up = "Up axis of the mesh",
  padding = "Empty voxels around",
  thickness = "Thickness",
  sign = "Inside by",
  interior = "Colours inside",
  interiorNone = "None",
  interiorNearest = "Of the nearest surface",
  channels = "Channels",
  labels = "Labels number the",
  animation = "Animation",
  animationNone = "None: the mesh as it is",
  fps = "Frames per second",
  run = "Voxelize",
  price = "{seconds} · {memory} memory · {bytes}",
  priceWait = "starts in {wait}",
  priceNow = "starts at once",
  priceCached = "stored already",
  queued = "Waiting: place {n} in the queue",
  queuedFor = "Waiting for {what}",
  running = "Voxelizing",
  runningTiles = "Voxelizing: {done} of {total} tiles",
  runningFrames = "Voxelizing: {done} of {total} frames",
  endsIn = "done in about {time}",
  fetching = "Fetching voxels",
  cancel = "Cancel",
  cancelled = "Cancelled.",
  done = "{voxels} voxels, {dims}",
  doneFrames = "animated voxels, {dims}",
  doneLevel = "shown at 1:{n}",
  preview = "Preview at {n}",
  look = "Look",
  style = "Style",
  channel = "Show",
  channelOwn = "Colours of the style",
  section = "Section",
  sectionOff = "Off",
  sectionAt = "Cut at {n} of {total}",
  flip = "Other side",
  box = "Box",
  boxEmpty = "The box is empty.",
  boxFrom = "Box along {axis} from",
  boxTo = "Box along {axis} to",
  resetView = "Reset view",
  viewHelp = "3D view. Drag or arrow keys turn, Shift moves, + and - zoom, R resets. A double click marks a voxel to measure from.",
  still = "This browser has no WebGL 2: the daemon draws the picture.",
  lost = "The graphics card was lost; the daemon draws the picture.",
  cell = "cell {x}, {y}, {z}",
  distanceIs = "distance {n}",
  measure = "{x}, {y}, {z} cells from the mark: {n} {unit}",
  coverageIs = "coverage {n}%",
  take = "Take home",
  format = "Format",
  download = "Download",
  downloadSize = "about {bytes}",
  downloaded = "{name}, {bytes}",
  preparing = "Making {name}",
  groupArrays = "Arrays",
  groupEditors = "Voxel editors",
  groupMinecraft = "Minecraft",
  groupMeshes = "Meshes",
  groupPoints = "Points",
  groupVolumes = "Volumes",
  groupNative = "voxeld",
  picture = "Picture",
  width = "Width",
  height = "Height",
  transparent = "Transparent",
  png = "PNG",
  gif = "Turntable GIF",
  gifFrames = "Animation GIF",
  share = "Share link",
  shareFor = "valid for",
  hour = "1 hour",
  day = "1 day",
  week = "7 days",
  month = "30 days",
  shared = "The link gives access to the file until {date}.",
  copy = "Copy",
  copied = "Copied.",
  copyAs = "The same by",
  play = "Play",
  pause = "Pause",
  frame = "Frame",
  frameOf = "{n} / {total}",
  offline = "The daemon does not answer; trying again.",
  online = "The daemon answers again.",
  busy = "The daemon is busy; trying again in {n} s.",
  expected = "expected {text}",
  got = "got {text}",
  dismiss = "Dismiss",
  keyTitle = "This daemon needs an API key",
  keyWrong = "This key is unknown, expired or revoked.",
  keyBad = "A key is printable ASCII.",
  keyField = "API key (vxk_…)",
  keyStay = "Remember in this tab",
  keyHint = "The key stays in memory and goes to this daemon alone.",
  keyUse = "Use key",
  keyForget = "Forget key",
  keyOf = "Key of {tenant}",
  adminTitle = "Activity",
  adminOpen = "There are no API keys: all see this page. voxeld keys add makes one.",
  adminTenant = "You see your own jobs and storage.",
  adminAll = "Admin: you see every tenant.",
  devices = "Devices",
  device = "Device",
  renderer = "Renderer",
  workers = "Workers busy",
  memory = "Memory",
  queue = "Queue",
  queueNone = "Nothing waits or runs.",
  queueOthers = "Others: {running} running, {queued} queued",
  tenant = "Tenant",
  job = "Job",
  state = "State",
  progress = "Progress",
  failures = "Recent failures",
  failuresNone = "No failures.",
  storage = "Storage",
  storageUse = "{bytes} used",
  storageOf = "{bytes} of {limit} used",
  disk = "{bytes} of all tenants; {free} of {total} free",
  results = "Results",
  assets = "Meshes",
  name = "Name",
  bytes = "Size",
  when = "When",
  nothing = "Nothing is stored.",
  showMore = "Show more",
  keys = "Keys",
  keyNew = "Key, shown only now",
  role = "Role",
  admin = "Admin",
  expires = "Expires",
  requests = "Requests",
  add = "Add",
  revoke = "Revoke",
  limits = "Limits",
  limitNone = "none",
  seconds = "{n} s",
  minutes = "{n} min",
  hours = "{n} h",
  between = "{low} to {high}",
}

/** Texts for names of the daemon. */
export const names: Readonly<Record<string, string>> = {
  sampleRocket: "Rocket",
  samplePlanet: "Planet",
  sampleKnot: "Knot",
  sampleWorm: "Worm",
  style_voxel: "Voxel",
  style_smooth: "Smooth",
  style_clay: "Clay",
  style_iso: "Iso",
  style_blueprint: "Blueprint",
  channel_color: "Colour",
  channel_normal: "Normal",
  channel_material: "Material",
  channel_label: "Label",
  channel_distance: "Distance",
  channel_coverage: "Coverage",
  option_layout: "Layout",
  option_axes: "Axes",
  option_dtype: "Samples",
  option_palette: "Palette",
  option_palette_max: "Colours, at most",
  option_dither: "Dithering",
  option_channel: "Channel",
  option_blocks: "Blocks",
  option_schem_version: "Version",
  option_zarr_version: "Version",
  option_mesh: "Surface",
  option_compress: "Compression",
  option_codec: "Codec",
  limit_requests_per_minute: "Requests a minute",
  limit_queued_jobs: "Queued jobs",
  limit_bytes: "Stored bytes",
  limit_cells: "Cells of a job",
};

/** The text of `key` with its {name}s replaced by `values`. */
export function t(text: T, values: Readonly<Record<string, string | number>>): string {
  return text.replace(/\{(\w+)\}/g, (whole, name: string) => String(values[name] ?? whole));
}

const number = new Intl.NumberFormat("en");

/** "12,345" */
export function count(n: number): string {
  return number.format(n);
}

/** "1.2 MB" of a number of bytes. */
export function bytesText(bytes: number): string {
  const units = ["B", "KB", "MB", "GB", "TB"];
  let unit = 0;
  while (bytes >= 999.5 && unit < units.length - 1) {
    bytes /= 1000;
    ++unit;
  }
  return `${bytes < 9.95 && unit > 0 ? bytes.toFixed(1) : Math.round(bytes)} ${units[unit]}`;
}

/** "0aff" of bytes. */
export function hexOf(bytes: Iterable<number>): string {
  return Array.from(bytes, byte => byte.toString(16).padStart(2, "0")).join("");
}

/** "3 s", "2 min" of seconds. */
export function duration(seconds: number): string {
  if (seconds < 0.95) return t(T.seconds, { n: Math.max(0.1, seconds).toFixed(1) });
  if (seconds < 99) return t(T.seconds, { n: Math.round(seconds) });
  if (seconds < 5400) return t(T.minutes, { n: Math.round(seconds / 60) });
  return t(T.hours, { n: (seconds / 3600).toFixed(1) });
}

/** What was expected, and what came. */
export function linesOf({ expected, got }: Partial<ErrorBody>): string[] {
  return [
    ...(expected ? [t(T.expected, { text: expected })] : []),
    ...(got ? [t(T.got, { text: got })] : []),
  ];
}

export function progressOf(job: JobStatus): string {
  if (job.state === "queued")
    return job.waiting_for
      ? t(T.queuedFor, { what: job.waiting_for })
      : t(T.queued, { n: job.queue_position });
  return job.frames_total > 0
    ? t(T.runningFrames, { done: job.frames_done, total: job.frames_total })
    : job.tiles_total > 1
      ? t(T.runningTiles, { done: job.tiles_done, total: job.tiles_total })
      : T.running;
}
