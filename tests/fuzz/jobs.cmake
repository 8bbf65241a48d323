voxeld_fuzzer(keys jobs_keys.cpp voxeld_jobs)
voxeld_fuzzer(jobs_input jobs_input.cpp voxeld_jobs)
target_sources(fuzz_jobs_input PRIVATE ../unit/store/memory_store.cpp)
