voxeld_fuzzer(keys jobs_keys.cpp voxeld_jobs)
