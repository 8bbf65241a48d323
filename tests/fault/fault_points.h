// Control of the library that makes one call fail (fault_points.cpp). It has to be in LD_PRELOAD,
// to come before the libraries whose functions it takes the place of.
#pragma once

extern "C" {
// From now on calls of the class are counted in all threads, and the `number`th fails, once.
// Classes: alloc, write, short-write, sync, rename, create, sqlite.
void voxeld_fault_arm(const char* fault_class, long number, int code);
void voxeld_fault_disarm();
// Calls of this thread do not count while it has paused more often than resumed.
void voxeld_fault_pause();
void voxeld_fault_resume();
// Whether one has failed, and how many were counted since voxeld_fault_arm().
int voxeld_fault_fired();
long voxeld_fault_count();
}
