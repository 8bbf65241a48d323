// The daemon's JSON, as far as the page reads it (proto/openapi.yaml has all of it).

export interface ErrorBody {
  readonly code: string;
  readonly detail: string;
  readonly expected?: string;
  readonly got?: string;
}

export interface Asset {
  readonly id: string;
  readonly filename: string;
  readonly bytes: number;
  readonly created_ms: number;
}

export interface AnimationInfo {
  readonly name: string;
  readonly frames: number | null;
  readonly frame_rate: number | null;
  readonly duration_s: number;
  readonly unusable: string | null;
}

export interface AssetDescription extends Asset {
  readonly format: string;
  readonly triangles: number;
  readonly voxels?: { readonly dims: readonly number[]; readonly voxel_count: number };
  readonly part_count?: number;
  readonly has_colors?: boolean;
  readonly watertight?: boolean | null;
  readonly open_edges?: number | null;
  readonly non_manifold_edges?: number | null;
  readonly materials: readonly { readonly name: string; readonly texture: string | null }[];
  readonly missing_files: readonly { readonly name: string; readonly needed_by: string }[];
  readonly animations?: readonly AnimationInfo[];
  readonly warnings: readonly { readonly code: string; readonly detail: string }[];
}

export interface Estimate {
  readonly seconds: number;
  readonly seconds_low: number;
  readonly seconds_high: number;
  readonly result_bytes: number;
  readonly host_bytes: number;
}

export interface DryRun {
  readonly cached: boolean;
  readonly queue_position: number;
  readonly estimate: Estimate;
  readonly expected_start_ms: number;
  readonly expected_end_ms: number;
}

export interface NamedId {
  readonly id: number;
  readonly name: string;
}

export interface GridMeta {
  readonly dims?: readonly [number, number, number];
  readonly origin?: readonly [number, number, number];
  readonly voxel_size?: readonly [number, number, number];
  readonly voxel_count?: number; // absent of frames
  readonly options?: { readonly distance?: string };
  readonly units?: string;
  readonly channels?: readonly string[];
  readonly materials?: readonly NamedId[];
  readonly labels?: readonly NamedId[];
  readonly fps?: number;
}

export interface JobResult {
  readonly bytes: number;
  readonly filename: string;
  readonly grid: string;
  readonly sequence: string;
  readonly meta?: GridMeta;
  readonly warnings: readonly { readonly code: string; readonly detail: string }[];
}

export type JobState = "queued" | "running" | "done" | "failed" | "cancelled";

export interface JobStatus {
  readonly id: string;
  readonly kind: string;
  readonly state: JobState;
  readonly filename?: string;
  readonly asset?: string;
  readonly tiles_done: number;
  readonly tiles_total: number;
  readonly frames_done: number;
  readonly frames_total: number;
  readonly queue_position: number;
  readonly created_ms: number;
  readonly ended_ms?: number;
  readonly expected_end_ms?: number;
  readonly waiting_for?: string;
  readonly cached: boolean;
  readonly result?: JobResult;
  readonly error?: ErrorBody;
  readonly tenant?: string;
  readonly device?: string;
  readonly options?: Readonly<Record<string, unknown>>;
}

export interface Me {
  readonly tenant: string;
  readonly key: string;
  readonly admin: boolean;
  readonly limits: Readonly<Record<string, number | null>>;
  readonly usage: Readonly<Record<string, number>>;
}

/** An API key; a new one has its secret as `key`. Limits of 0 are none. */
export interface Key {
  readonly id: string;
  readonly name: string;
  readonly admin: boolean;
  readonly limits: Readonly<Record<string, number>>;
  readonly expires_ms: number; // 0: never
  readonly state: string;
  readonly key?: string;
}

export interface Queue {
  readonly queued: number;
  readonly running: number;
  readonly others: { readonly queued: number; readonly running: number };
  readonly devices: readonly {
    readonly device: string;
    readonly renderer: string;
    readonly workers: number;
    readonly workers_busy: number;
    readonly memory_bytes?: number; // absent if other tenants' is not shown
  }[];
  readonly store?: {
    readonly bytes: number;
    readonly disk_free_bytes: number;
    readonly disk_bytes: number;
  };
  readonly jobs: readonly JobStatus[];
  readonly next?: string;
}

export interface StoredResult {
  readonly job: string;
  readonly bytes: number;
  readonly filename: string;
  readonly grid: string;
  readonly sequence: string;
  readonly created_ms: number;
}

export function hasEnded(job: JobStatus): boolean {
  return job.state !== "queued" && job.state !== "running";
}
