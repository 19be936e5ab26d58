// SPDX-License-Identifier: MIT
/* Two slots on a block device. A slot: header, padded to whole program units; the state, padded
 * likewise. The header is programmed last: without it the slot counts as empty. */
#include "pelorus/state_store.h"

#include <string.h>

#include "pelorus/assertions.h"
#include "pelorus/wire.h"
#include "record/codec.h"

/* ---------------------------------------------------------------- header: docs/STATE-FORMAT.md */

typedef struct slot_header {
    uint32_t magic, version;
    uint64_t generation;
    uint32_t length, crc; /* of the state */
    uint32_t own_crc;
} slot_header;

static const plr_field header_fields[] = {
#define FIELD(member, kind_, about)                                                                \
    {.offset = offsetof(slot_header, member), .kind = PLR_FIELD_##kind_, .count = 1},
#include "session/slot.def"
};

/* "PLRS" */
#define SLOT_MAGIC 0x53524C50U

enum { STORE_VERSION = 1, OWN_CRC = PLR_STORE_HEADER - 4 /* where the last field begins */ };

/* Moves the next bytes of a header that is written. */
static bool to_header(void *context, uint8_t *bytes, unsigned n) {
    uint8_t **at = context;
    memcpy(*at, bytes, n);
    *at += n;
    return true;
}

static void pass_header(plr_codec *c, slot_header *header) {
    plr_codec_fields(c, header, header_fields, sizeof header_fields / sizeof *header_fields);
    PLR_ASSERT(c->status == PLR_OK && c->left == 0);
}

static void write_header(uint8_t bytes[PLR_STORE_HEADER], slot_header header) {
    for (unsigned pass = 0; pass < 2;
         pass++) { /* the second with the CRC of what the first wrote */
        uint8_t *at = bytes;
        plr_codec codec = {.direction = PLR_CODEC_WRITE, .move = to_header, .context = &at};
        pass_header(&codec, &header);
        header.own_crc = plr_crc32(0, bytes, OWN_CRC);
    }
}

/* PLR_OK; PLR_E_NOT_READY the bytes are no header at all; PLR_E_CORRUPT one that is damaged;
 * PLR_E_FOREIGN of another version: only the generation means something. */
static plr_status read_header(const uint8_t bytes[PLR_STORE_HEADER], slot_header *header) {
    const uint8_t *at = bytes;
    plr_codec codec = {.direction = PLR_CODEC_READ,
                       .move = plr_codec_take,
                       .context = &at,
                       .left = PLR_STORE_HEADER};
    memset(header, 0, sizeof *header);
    pass_header(&codec, header);
    if (header->magic != SLOT_MAGIC)
        return PLR_E_NOT_READY;
    if (header->own_crc != plr_crc32(0, bytes, OWN_CRC))
        return PLR_E_CORRUPT;
    return header->version == STORE_VERSION ? PLR_OK : PLR_E_FOREIGN;
}

/* ---------------------------------------------------------------- geometry */

static uint32_t rounded_up(uint32_t n, uint32_t unit) {
    return (n + unit - 1) / unit * unit;
}

/* Bytes of the header with its padding: at most one buffer. */
static uint32_t header_space(const plr_state_store *store) {
    return rounded_up(PLR_STORE_HEADER, store->device.program_size);
}

/* Bytes of a slot that must be erased for a state of that length. */
static uint32_t occupied(const plr_state_store *store, uint32_t length) {
    return rounded_up(header_space(store) + length, store->device.erase_size);
}

static uint32_t slot_start(const plr_state_store *store, unsigned slot) {
    return slot * store->slot_size;
}

plr_status plr_state_store_init(plr_state_store *store, const plr_block_device *device) {
    if (!store || !device || !device->read || !device->program || !device->erase)
        return PLR_E_ARGUMENT;
    const uint32_t unit = device->program_size, block = device->erase_size;
    if (unit < 1 || unit > PLR_STORE_BUFFER || block < 1 || block % unit != 0 ||
        device->size % block != 0)
        return PLR_E_ARGUMENT;
    memset(store, 0, sizeof *store);
    store->device = *device;
    store->slot_size = device->size / block / PLR_STORE_SLOTS * block;
    return store->slot_size > header_space(store) ? PLR_OK : PLR_E_FULL;
}

uint32_t plr_state_store_needs(const plr_state_store *store, const plr_filter *f) {
    const plr_config *config = plr_filter_config(f);
    const uint32_t length = config ? plr_filter_saved_size(f, config->slots) : 0;
    return store && length > 0 ? PLR_STORE_SLOTS * occupied(store, length) : 0;
}

/* ---------------------------------------------------------------- looking */

static bool read_bytes(const plr_state_store *store, uint32_t offset, uint8_t *bytes, uint32_t n) {
    return store->device.read(store->device.context, offset, bytes, n) == 0;
}

/* CRC of n bytes at an offset of the device; false if they cannot be read. */
static bool read_crc(plr_state_store *store, uint32_t offset, uint32_t n, uint32_t *crc) {
    *crc = 0;
    while (n > 0) {
        const uint32_t piece = n < PLR_STORE_BUFFER ? n : PLR_STORE_BUFFER;
        if (!read_bytes(store, offset, store->buffer, piece))
            return false;
        *crc = plr_crc32(*crc, store->buffer, piece);
        offset += piece;
        n -= piece;
    }
    return true;
}

/* What one slot contains. PLR_OK a whole state; PLR_E_FOREIGN a whole header of another version, of
 * which only the generation is known; PLR_E_NOT_READY nothing; PLR_E_CORRUPT; PLR_E_IO. */
static plr_status look_into(plr_state_store *store, unsigned slot, slot_header *header) {
    uint8_t bytes[PLR_STORE_HEADER];
    uint32_t crc;
    if (!read_bytes(store, slot_start(store, slot), bytes, sizeof bytes))
        return PLR_E_IO;
    const plr_status status = read_header(bytes, header);
    if (status != PLR_OK)
        return status;
    if (header->length == 0 || header->length > store->slot_size - header_space(store))
        return PLR_E_CORRUPT;
    if (!read_crc(store, slot_start(store, slot) + header_space(store), header->length, &crc))
        return PLR_E_IO;
    return crc == header->crc ? PLR_OK : PLR_E_CORRUPT;
}

/* Both slots, and which of them is the newest whole one. */
typedef struct plr_store_view {
    plr_status status[PLR_STORE_SLOTS];
    slot_header header[PLR_STORE_SLOTS];
    int newest; /* slot, or -1 */
} plr_store_view;

static void look_around(plr_state_store *store, plr_store_view *view) {
    view->newest = -1;
    for (int slot = 0; slot < PLR_STORE_SLOTS; slot++) {
        const plr_status status = look_into(store, (unsigned)slot, &view->header[slot]);
        view->status[slot] = status;
        if ((status == PLR_OK || status == PLR_E_FOREIGN) &&
            (view->newest < 0 ||
             view->header[slot].generation > view->header[view->newest].generation))
            view->newest = slot;
    }
}

/* `stored` may be NULL. */
static void describe(plr_stored_state *stored, unsigned slot, const slot_header *header) {
    if (!stored)
        return;
    stored->generation = header->generation;
    stored->length = header->length;
    stored->slot = (uint8_t)slot;
}

/* ---------------------------------------------------------------- save */

/* A save in progress. */
typedef struct plr_store_writer {
    plr_state_store *store;
    uint32_t at; /* offset of the device at which the buffer will be programmed */
    uint32_t fill;
    uint32_t room; /* bytes of the buffer that are whole program units */
    uint32_t length, crc;
} plr_store_writer;

static bool program(const plr_state_store *store, uint32_t offset, uint32_t n) {
    return store->device.program(store->device.context, offset, store->buffer, n) == 0;
}

/* Programs the buffer, padded with zeros to whole units. */
static bool flush(plr_store_writer *writer) {
    plr_state_store *store = writer->store;
    const uint32_t n = rounded_up(writer->fill, store->device.program_size);
    memset(store->buffer + writer->fill, 0, n - writer->fill);
    if (n > 0 && !program(store, writer->at, n))
        return false;
    writer->at += n;
    writer->fill = 0;
    return true;
}

/* A plr_state_sink. */
static int append_state(void *context, const uint8_t *bytes, uint32_t n) {
    plr_store_writer *writer = context;
    writer->crc = plr_crc32(writer->crc, bytes, n);
    writer->length += n;
    while (n > 0) {
        const uint32_t room = writer->room - writer->fill;
        const uint32_t piece = n < room ? n : room;
        memcpy(writer->store->buffer + writer->fill, bytes, piece);
        writer->fill += piece;
        bytes += piece;
        n -= piece;
        if (writer->fill == writer->room && !flush(writer))
            return -1;
    }
    return 0;
}

/* Block by block from the start: the old header goes first. */
static bool erase_blocks(const plr_state_store *store, uint32_t offset, uint32_t n) {
    const uint32_t block = store->device.erase_size;
    for (uint32_t done = 0; done < n; done += block)
        if (store->device.erase(store->device.context, offset + done, block) != 0)
            return false;
    return true;
}

static bool program_header(plr_state_store *store, unsigned slot, const slot_header *header) {
    uint8_t back[PLR_STORE_HEADER];
    memset(store->buffer, 0, header_space(store));
    write_header(store->buffer, *header);
    return program(store, slot_start(store, slot), header_space(store)) &&
           read_bytes(store, slot_start(store, slot), back, sizeof back) &&
           memcmp(back, store->buffer, sizeof back) == 0;
}

static plr_status write_slot(plr_state_store *store, unsigned slot, uint64_t generation,
                             const plr_filter *f, plr_stored_state *saved) {
    const uint32_t unit = store->device.program_size;
    const uint32_t start = slot_start(store, slot), state = start + header_space(store);
    plr_store_writer writer = {.store = store, .at = state, .room = PLR_STORE_BUFFER / unit * unit};
    uint32_t crc;
    if (!erase_blocks(store, start, occupied(store, plr_filter_saved_size(f, f->belief.count))))
        return PLR_E_IO;
    const plr_status status = plr_filter_save(f, append_state, &writer);
    if (status != PLR_OK)
        return status;
    if (!flush(&writer) || !read_crc(store, state, writer.length, &crc) || crc != writer.crc)
        return PLR_E_IO;
    const slot_header header = {.magic = SLOT_MAGIC,
                                .version = STORE_VERSION,
                                .generation = generation,
                                .length = writer.length,
                                .crc = writer.crc};
    if (!program_header(store, slot, &header))
        return PLR_E_IO;
    describe(saved, slot, &header);
    return PLR_OK;
}

plr_status plr_state_store_save(plr_state_store *store, const plr_filter *f,
                                plr_stored_state *saved) {
    plr_store_view view;
    if (saved)
        memset(saved, 0, sizeof *saved);
    if (!store)
        return PLR_E_ARGUMENT;
    const plr_status status = plr_filter_save(f, NULL, NULL);
    if (status != PLR_OK)
        return status;
    if (plr_state_store_needs(store, f) > PLR_STORE_SLOTS * store->slot_size)
        return PLR_E_FULL;
    look_around(store, &view);
    if (view.newest < 0)
        return write_slot(store, view.status[0] == PLR_E_IO ? 1 : 0, 1, f, saved);
    return write_slot(store, view.newest == 0 ? 1 : 0, view.header[view.newest].generation + 1, f,
                      saved);
}

/* ---------------------------------------------------------------- restore */

/* A restore in progress: the CRC is computed once more, of the very bytes that the filter reads. */
typedef struct plr_store_reader {
    const plr_state_store *store;
    uint32_t state; /* where the state begins on the device */
    uint32_t crc;
} plr_store_reader;

/* A plr_state_source. */
static int read_state(void *context, uint32_t offset, uint8_t *bytes, uint32_t n) {
    plr_store_reader *reader = context;
    if (!read_bytes(reader->store, reader->state + offset, bytes, n))
        return -1;
    reader->crc = plr_crc32(offset == 0 ? 0 : reader->crc, bytes, n);
    return 0;
}

static plr_status read_slot(plr_state_store *store, unsigned slot, const slot_header *header,
                            plr_filter *f) {
    plr_store_reader reader = {.store = store,
                               .state = slot_start(store, slot) + header_space(store)};
    const plr_status status = plr_filter_restore(f, header->length, read_state, &reader);
    if (status != PLR_OK || reader.crc == header->crc)
        return status;
    (void)plr_filter_reset(f);
    return PLR_E_CORRUPT;
}

/* Why there is no whole state: the worst that was found. */
static plr_status worst_of(const plr_store_view *view) {
    plr_status worst = PLR_E_NOT_READY;
    for (unsigned slot = 0; slot < PLR_STORE_SLOTS; slot++)
        if (view->status[slot] == PLR_E_IO || worst == PLR_E_NOT_READY)
            worst = view->status[slot];
    return worst;
}

plr_status plr_state_store_restore(plr_state_store *store, plr_filter *f, plr_stored_state *found) {
    plr_store_view view;
    if (found)
        memset(found, 0, sizeof *found);
    if (!store || !f)
        return PLR_E_ARGUMENT;
    look_around(store, &view);
    for (unsigned slot = 0; found && slot < PLR_STORE_SLOTS; slot++)
        if (view.status[slot] == PLR_E_CORRUPT || view.status[slot] == PLR_E_IO)
            found->damaged++;
    if (view.newest < 0)
        return worst_of(&view);
    const unsigned slot = (unsigned)view.newest;
    if (view.status[slot] != PLR_OK)
        return view.status[slot];
    const plr_status status = read_slot(store, slot, &view.header[slot], f);
    if (status == PLR_OK)
        describe(found, slot, &view.header[slot]);
    return status;
}
