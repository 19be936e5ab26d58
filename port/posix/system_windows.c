// SPDX-License-Identifier: MIT
/* CMake takes this file for Windows. Paths are those of its narrow functions. */
#include <errno.h>
#include <fcntl.h>
#include <io.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <windows.h>

#include "posix/system.h"

void system_begin(void) {
    (void)_setmode(_fileno(stdin), _O_BINARY);
    (void)_setmode(_fileno(stdout), _O_BINARY);
}

int system_open_to_read(const char *path) {
    return _open(path, _O_RDONLY | _O_BINARY);
}

int system_open_to_change(const char *path) {
    return _open(path, _O_RDWR | _O_CREAT | _O_BINARY, _S_IREAD | _S_IWRITE);
}

/* Bytes that one call of the system takes. */
static unsigned piece(size_t n) {
    return n < (1u << 30) ? (unsigned)n : 1u << 30;
}

long system_read(int fd, void *bytes, size_t n) {
    return _read(fd, bytes, piece(n));
}

/* There is no read or write at an offset: the place is changed, and set back. */
static bool seek(int fd, uint64_t offset) {
    return _lseeki64(fd, (__int64)offset, SEEK_SET) >= 0;
}

long system_read_at(int fd, void *bytes, size_t n, uint64_t offset) {
    const __int64 before = _telli64(fd);
    const long count = seek(fd, offset) ? _read(fd, bytes, piece(n)) : -1;
    return before >= 0 && seek(fd, (uint64_t)before) ? count : -1;
}

long system_write_at(int fd, const void *bytes, size_t n, uint64_t offset) {
    const __int64 before = _telli64(fd);
    const long count = seek(fd, offset) ? _write(fd, bytes, piece(n)) : -1;
    return before >= 0 && seek(fd, (uint64_t)before) ? count : -1;
}

bool system_sync(int fd) {
    return _commit(fd) == 0;
}

/* NTFS keeps a journal of names; no program can ask for more. */
bool system_sync_name(const char *path) {
    (void)path;
    return true;
}

/* A handle that asks for nothing but what the file is. */
static HANDLE handle_of(const char *path) {
    return CreateFileA(path, 0, FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE, NULL,
                       OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, NULL);
}

static bool identify(const char *path, BY_HANDLE_FILE_INFORMATION *about) {
    const HANDLE handle = handle_of(path);
    if (handle == INVALID_HANDLE_VALUE)
        return false;
    const bool found = GetFileInformationByHandle(handle, about) != 0;
    CloseHandle(handle);
    return found;
}

bool system_same_file(const char *a, const char *b) {
    BY_HANDLE_FILE_INFORMATION one, other;
    return identify(a, &one) && identify(b, &other) &&
           one.dwVolumeSerialNumber == other.dwVolumeSerialNumber &&
           one.nFileIndexHigh == other.nFileIndexHigh && one.nFileIndexLow == other.nFileIndexLow;
}

system_output system_output_at(const char *path) {
    const HANDLE handle = handle_of(path);
    if (handle == INVALID_HANDLE_VALUE)
        return SYSTEM_NEW;
    BY_HANDLE_FILE_INFORMATION about;
    const bool file = GetFileType(handle) == FILE_TYPE_DISK &&
                      GetFileInformationByHandle(handle, &about) != 0 &&
                      (about.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY) == 0;
    CloseHandle(handle);
    return file ? SYSTEM_FILE : SYSTEM_AS_IT_STANDS;
}

bool system_may_write(const char *path) {
    return _access(path, 2) == 0;
}

bool system_target(char *target, size_t size, const char *path) {
    return _fullpath(target, path, size) != NULL;
}

void system_unfinished(const char *part) {
    (void)part;
}

void system_released(const char *part) {
    (void)part;
}

bool system_put_in_place(const char *part, const char *target) {
    if (MoveFileExA(part, target, MOVEFILE_REPLACE_EXISTING) != 0)
        return true;
    errno = GetLastError() == ERROR_ACCESS_DENIED ? EACCES : EIO;
    return false;
}
