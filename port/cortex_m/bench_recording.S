// SPDX-License-Identifier: MIT
/* The recording that main_bench.c replays, as it is: bytes of a .plr file. */
    .section .rodata.bench_recording, "a"
    .global bench_recording
    .global bench_recording_end
bench_recording:
    .incbin BENCH_RECORDING
bench_recording_end:
