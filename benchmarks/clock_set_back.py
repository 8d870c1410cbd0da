"""A calendar clock that goes an hour back, for some processes alone: no other program of the computer is disturbed.

A small library that is loaded first answers for the C library. Where the file that `CLOCK` names exists, it tells an
hour less. The monotonic clock stays as it is, as on a computer whose clock is set.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

CLOCK = "CLOCK_BACK"
"""Environment variable with the path of the file that sets the clock back."""
BACK_S = 3600
_SOURCE = """
#define _GNU_SOURCE
#include <dlfcn.h>
#include <stdlib.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static long back(void) {
    const char *path = getenv("%s");
    return path && access(path, F_OK) == 0 ? %d : 0;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    static int (*real)(clockid_t, struct timespec *);
    if (!real) real = (int (*)(clockid_t, struct timespec *))dlsym(RTLD_NEXT, "clock_gettime");
    int failed = real(clock, now);
    if (!failed && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) now->tv_sec -= back();
    return failed;
}

int gettimeofday(struct timeval *now, void *zone) {
    struct timespec exact;
    (void)zone;
    int failed = clock_gettime(CLOCK_REALTIME, &exact);
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return failed;
}

time_t time(time_t *result) {
    struct timespec exact;
    clock_gettime(CLOCK_REALTIME, &exact);
    if (result) *result = exact.tv_sec;
    return exact.tv_sec;
}
"""


def library(folder: Path) -> Path:
    """The library for LD_PRELOAD, compiled in a folder by the C compiler `cc`."""
    source, found = folder / "clock_set_back.c", folder / "clock_set_back.so"
    if not found.exists():
        source.write_text(_SOURCE % (CLOCK, BACK_S))
        subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(found), str(source), "-ldl"], check=True)
    return found
