// SPDX-License-Identifier: MIT
// pelorus-replay in a worker: the program as it is on a desk, over files in memory (WASI, preview 1).
"use strict";

const OK = 0, BAD_FILE = 8, NO_ENTRY = 44, NOT_SUPPORTED = 58;
const STREAMS = 3, FOLDER = 3; // descriptors: the standard streams, and the one folder that there is
const CREATE = 1, TRUNCATE = 8; // of path_open
const REGULAR = 4, DIRECTORY = 3, CHARACTERS = 2;

class Exit extends Error {
    constructor(status) {
        super("the program has ended");
        this.status = status;
    }
}

// Files by name, each {bytes, length}; grows as it is written.
class Files {
    constructor(given) {
        this.all = new Map();
        for (const [name, bytes] of Object.entries(given))
            this.all.set(name, { bytes, length: bytes.length });
    }
    read(name) {
        const file = this.all.get(name);
        return file ? file.bytes.slice(0, file.length) : null;
    }
}

function write(file, at, piece) {
    const end = at + piece.length;
    if (end > file.bytes.length) {
        const larger = new Uint8Array(Math.max(end, 2 * file.bytes.length, 1 << 16));
        larger.set(file.bytes.subarray(0, file.length));
        file.bytes = larger;
    }
    file.bytes.set(piece, at);
    file.length = Math.max(file.length, end);
}

// The functions of the system that the program imports. `words` are its arguments.
function system(words, files, said) {
    let memory;
    const open = new Map(); // descriptor -> {file, at}
    const view = () => new DataView(memory.buffer);
    const bytes = (at, n) => new Uint8Array(memory.buffer, at, n);
    const text = (at, n) => new TextDecoder().decode(bytes(at, n));
    const encoded = words.map((word) => new TextEncoder().encode(word + "\0"));

    function vectors(list, count, each) {
        let total = 0;
        for (let i = 0; i < count; i++) {
            const at = view().getUint32(list + 8 * i, true), n = view().getUint32(list + 8 * i + 4, true);
            const done = each(at, n);
            total += done;
            if (done < n)
                break;
        }
        return total;
    }
    function stat(at, type, size) {
        bytes(at, 64).fill(0);
        view().setUint8(at + 16, type);
        view().setBigUint64(at + 32, BigInt(size), true);
        return OK;
    }
    const table = {
        args_sizes_get(count, size) {
            view().setUint32(count, encoded.length, true);
            view().setUint32(size, encoded.reduce((sum, word) => sum + word.length, 0), true);
            return OK;
        },
        args_get(list, at) {
            for (const [i, word] of encoded.entries()) {
                view().setUint32(list + 4 * i, at, true);
                bytes(at, word.length).set(word);
                at += word.length;
            }
            return OK;
        },
        environ_sizes_get(count, size) {
            view().setUint32(count, 0, true);
            view().setUint32(size, 0, true);
            return OK;
        },
        environ_get: () => OK,
        clock_time_get(id, precision, at) {
            view().setBigUint64(at, BigInt(Math.round(performance.now() * 1e6)), true);
            return OK;
        },
        proc_exit(status) {
            throw new Exit(status);
        },
        fd_prestat_get(fd, at) {
            if (fd !== FOLDER)
                return BAD_FILE;
            view().setUint32(at, 0, true);
            view().setUint32(at + 4, 1, true);
            return OK;
        },
        fd_prestat_dir_name(fd, at) {
            bytes(at, 1)[0] = ".".charCodeAt(0);
            return OK;
        },
        path_open(fd, flags, at, n, how, rights, inherited, more, result) {
            const name = text(at, n);
            let file = files.all.get(name);
            if (!file && !(how & CREATE))
                return NO_ENTRY;
            if (!file || how & TRUNCATE) {
                file = { bytes: new Uint8Array(0), length: 0 };
                files.all.set(name, file);
            }
            let free = FOLDER + 1;
            while (open.has(free))
                free++;
            open.set(free, { file, at: 0 });
            view().setUint32(result, free, true);
            return OK;
        },
        fd_close(fd) {
            return open.delete(fd) || fd <= FOLDER ? OK : BAD_FILE;
        },
        fd_read(fd, list, count, result) {
            const from = open.get(fd);
            if (!from && fd !== 0)
                return BAD_FILE;
            view().setUint32(result, !from ? 0 : vectors(list, count, (at, n) => {
                const piece = from.file.bytes.subarray(from.at, Math.min(from.at + n, from.file.length));
                bytes(at, piece.length).set(piece);
                from.at += piece.length;
                return piece.length;
            }), true);
            return OK;
        },
        fd_pread(fd, list, count, offset, result) {
            const from = open.get(fd);
            if (!from)
                return BAD_FILE;
            const before = from.at;
            from.at = Number(offset);
            const status = table.fd_read(fd, list, count, result);
            from.at = before;
            return status;
        },
        fd_write(fd, list, count, result) {
            const to = open.get(fd);
            if (!to && fd >= STREAMS)
                return BAD_FILE;
            view().setUint32(result, vectors(list, count, (at, n) => {
                if (to) {
                    write(to.file, to.at, bytes(at, n));
                    to.at += n;
                } else {
                    said[fd === 2 ? "err" : "out"] += text(at, n);
                }
                return n;
            }), true);
            return OK;
        },
        fd_seek(fd, offset, whence, result) {
            const at = open.get(fd);
            if (!at)
                return fd < STREAMS ? NOT_SUPPORTED : BAD_FILE;
            at.at = Number(offset) + [0, at.at, at.file.length][whence];
            view().setBigUint64(result, BigInt(at.at), true);
            return OK;
        },
        fd_fdstat_get(fd, at) {
            bytes(at, 24).fill(0);
            view().setUint8(at, fd < STREAMS ? CHARACTERS : fd === FOLDER ? DIRECTORY : REGULAR);
            view().setBigUint64(at + 8, ~0n & 0xffffffffn, true);
            view().setBigUint64(at + 16, ~0n & 0xffffffffn, true);
            return OK;
        },
        fd_filestat_get(fd, at) {
            const from = open.get(fd);
            return stat(at, from ? REGULAR : CHARACTERS, from ? from.file.length : 0);
        },
        path_filestat_get(fd, flags, at, n, result) {
            const file = files.all.get(text(at, n));
            return file ? stat(result, REGULAR, file.length) : NO_ENTRY;
        },
        path_rename(fd, at, n, other, to, m) {
            const name = text(at, n), file = files.all.get(name);
            if (!file)
                return NO_ENTRY;
            files.all.delete(name);
            files.all.set(text(to, m), file);
            return OK;
        },
        path_unlink_file(fd, at, n) {
            return files.all.delete(text(at, n)) ? OK : NO_ENTRY;
        },
    };
    return { table, use: (lent) => { memory = lent; } };
}

// Does this browser fuse? (1 + 2^-12)^2 - (1 + 2^-11) is 2^-24 where a product is not rounded, and else 0.
function fuses() {
    const program = Uint8Array.of(
        0, 0x61, 0x73, 0x6d, 1, 0, 0, 0, 1, 8, 1, 0x60, 3, 0x7d, 0x7d, 0x7d, 1, 0x7d, 3, 2, 1, 0,
        7, 5, 1, 1, 0x66, 0, 0, 0x0a, 0x16, 1, 0x14, 0, 0x20, 0, 0xfd, 0x13, 0x20, 1, 0xfd, 0x13,
        0x20, 2, 0xfd, 0x13, 0xfd, 0x85, 2, 0xfd, 0x1f, 0, 0x0b);
    try {
        const { f } = new WebAssembly.Instance(new WebAssembly.Module(program)).exports;
        return f(1 + 2 ** -12, 1 + 2 ** -12, -(1 + 2 ** -11)) === 2 ** -24;
    } catch {
        return false; // it does not know the instruction
    }
}

// Runs the program; {status, out, err, files, milliseconds}.
async function replay(program, words, given) {
    const files = new Files(given), said = { out: "", err: "" };
    const { table, use } = system(["pelorus-replay", ...words], files, said);
    const refused = new Proxy(table, { get: (has, name) => has[name] ?? (() => NOT_SUPPORTED) });
    const module = await WebAssembly.compile(program);
    const begun = performance.now();
    const imports = {};
    for (const { name } of WebAssembly.Module.imports(module))
        imports[name] = refused[name];
    const instance = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: imports });
    use(instance.exports.memory);
    let status = 0;
    try {
        instance.exports._start();
    } catch (end) {
        if (!(end instanceof Exit))
            throw end;
        status = end.status;
    }
    return { status, ...said, files, milliseconds: performance.now() - begun };
}
