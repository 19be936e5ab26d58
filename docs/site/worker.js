// SPDX-License-Identifier: MIT
// What the page asks of a worker: one run of the replay.
"use strict";

onmessage = async ({ data }) => {
    try {
        const fast = fuses();
        postMessage({ begins: true, fast });
        const done = await replay(fast ? data.relaxed : data.portable, data.words, { "drive.plr": data.recording });
        const path = done.files.read("path.tum");
        postMessage({ ...done, files: undefined, fast, path });
    } catch (error) {
        postMessage({ status: -1, out: "", err: `The replay has stopped: ${error.message}`, path: null });
    }
};
