// SPDX-License-Identifier: MIT
/*
 * The frame format of recordings and links. docs/REPLAY-FORMAT.md describes every byte.
 *
 * A reader turns received bytes into messages; frames that are damaged, unknown, malformed or too
 * long are skipped and counted. A writer turns messages into bytes and passes them to a function.
 * Neither allocates memory or depends on the filter. Messages hold numbers as double, also where
 * the frame has float32.
 */
#ifndef PELORUS_WIRE_H
#define PELORUS_WIRE_H

#include <stddef.h>

#include "pelorus/rig.h"
#include "pelorus/types.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum plr_kind {
    PLR_KIND_NONE = 0,
    PLR_KIND_HEADER = 1,
    PLR_KIND_CONFIG = 2,
    PLR_KIND_START = 3,
    PLR_KIND_TWIST = 4,
    PLR_KIND_STEREO = 5,
    PLR_KIND_TRUTH = 6,
    PLR_KIND_LANDMARK = 7,
    PLR_KIND_POSE = 8,
    PLR_KIND_REPORT = 9,
    PLR_KIND_TEXT = 10,
    PLR_KIND_END = 11,
    PLR_KIND_STATE = 12,
    PLR_KIND_READING = 13,
    PLR_KIND_IMU = 14,
    PLR_KIND_EVIDENCE = 15,
    PLR_KIND_CALIBRATION = 16,
    PLR_KIND_IMAGE = 17,
    PLR_KIND_RIG = 18
} plr_kind;

enum {
    PLR_WIRE_VERSION_MAJOR = 1,
    PLR_WIRE_VERSION_MINOR = 9,
    PLR_WIRE_KINDS = 18,     /* kinds are 1 to this */
    PLR_WIRE_OVERHEAD = 7,   /* kind, sequence, CRC */
    PLR_WIRE_NAME_SIZE = 64, /* with the closing zero */
    PLR_WIRE_MAX_SETTINGS = 64,
    PLR_WIRE_MAX_OBSERVATIONS = 4096,
    PLR_WIRE_MAX_IMU = 20, /* readings in one IMU message: it is shorter than the longest CONFIG */
    PLR_WIRE_MAX_TEXT = 240
};

/* A value on the diagonal of a POSE's covariances that means "not known". 2^40: exact in both
 * precisions, and larger than any variance that the filter accepts. */
#define PLR_WIRE_UNKNOWN_VARIANCE 1099511627776.0

/* Most bytes of a STEREO with n observations: the buffer that a reader needs for it. */
#define PLR_WIRE_STEREO_BODY(n) (PLR_WIRE_OVERHEAD + 12 + 24 * (n))

/* The smallest buffer of a reader: enough for all kinds but STEREO, CONFIG being the longest. */
#define PLR_WIRE_MIN_BUFFER (PLR_WIRE_OVERHEAD + 11 + 9 * PLR_WIRE_MAX_SETTINGS)

/* Most pixels of an IMAGE that every reader takes; a sender that knows its reader's buffer may send more. */
#define PLR_WIRE_IMAGE_PIXELS (PLR_WIRE_MIN_BUFFER - PLR_WIRE_OVERHEAD - 19)

typedef enum plr_body_axes {
    PLR_AXES_FLU = 0, /* forward, left, up */
    PLR_AXES_FRD = 1, /* forward, right, down */
    PLR_AXES_OTHER = 2
} plr_body_axes;

typedef struct plr_header {
    uint8_t version_major, version_minor; /* as read; a writer ignores them, and writes its own */
    uint8_t body_axes;                    /* plr_body_axes */
    uint8_t twist_timing;                 /* plr_twist_timing */
    uint8_t process; /* plr_process_kind; PLR_PROCESS_TWIST from senders before format 1.4 */
    uint16_t image_width_px, image_height_px; /* 0: unknown */
    plr_calibration calibration;
    /* Values that the recorder suggests for settings (settings.h); negative: no suggestion. */
    double pixel_sigma_px, velocity_sigma_mps, gyro_sigma_radps;
    double bias_velocity_sigma_mps, bias_gyro_sigma_radps;
    double bias_velocity_walk, bias_gyro_walk; /* (m/s)^2/s, (rad/s)^2/s */
    /* Along the body's x, y, z, where they differ; 0 or negative: as for all axes, above. */
    double velocity_sigma_axes_mps[3], gyro_sigma_axes_radps[3];
    /* Suggestions for an IMU's settings; negative: none, as from senders before format 1.4. */
    double gyro_noise, accel_noise; /* rad/s/sqrt(Hz), m/s^2/sqrt(Hz) */
    double gyro_walk, accel_walk;   /* rad/s^2/sqrt(Hz), m/s^3/sqrt(Hz) */
    double bias_accel_sigma_mps2, gravity_mps2;
    char name[PLR_WIRE_NAME_SIZE];
} plr_header;

typedef struct plr_wire_setting {
    uint8_t id;
    double value;
} plr_wire_setting;

typedef struct plr_config_message {
    uint32_t build_fingerprint; /* 0: a request for settings; else the settings that a build uses */
    uint16_t max_landmarks, max_observations;
    uint8_t block_observations;
    uint8_t real_bytes;
    uint8_t count;
    plr_wire_setting settings[PLR_WIRE_MAX_SETTINGS];
} plr_config_message;

typedef struct plr_start {
    plr_time_ns t_ns;
    plr_pose T_WB;
    bool has_covariance, has_bias;
    double P_xi[21]; /* covariance of (rho, theta): lower triangle, row by row; m^2, rad^2 */
    /* (b_v, b_w), m/s and rad/s; with an IMU (b_a, b_g), m/s^2 and rad/s */
    double bias[6], bias_variance[6];
    double velocity[3];          /* along the body's axes, m/s */
    double velocity_variance[3]; /* (m/s)^2. Not all above 0: the velocity is not given, as from
                                    senders before format 1.4 */
} plr_start;

typedef struct plr_twist_message {
    plr_time_ns t_ns;
    plr_twist twist;
} plr_twist_message;

/* Successive readings of an IMU at a constant rate: reading k is of t_ns + k period_ns. */
typedef struct plr_imu_message {
    plr_time_ns t_ns;
    uint32_t period_ns;                 /* 0 where there is one reading */
    uint8_t count;                      /* 1 to PLR_WIRE_MAX_IMU */
    plr_imu readings[PLR_WIRE_MAX_IMU]; /* the frame has float32 */
} plr_imu_message;

/* The velocity and the biases are for whoever judges a result: no filter looks at them. */
enum { PLR_TRUTH_VELOCITY = 1, PLR_TRUTH_BIAS = 2 };

typedef struct plr_truth {
    plr_time_ns t_ns;
    plr_pose T_WB;
    double v_B_mps[3]; /* along the body's axes */
    double bias[6];    /* as in plr_start */
    uint8_t knows;     /* PLR_TRUTH_VELOCITY, PLR_TRUTH_BIAS: what of them is given; 0 from senders
                          before format 1.4 */
} plr_truth;

typedef enum plr_landmark_role {
    PLR_LANDMARK_KNOWN = 0,   /* an input: its position is given */
    PLR_LANDMARK_EVICTED = 1, /* an output: it left the filter */
    PLR_LANDMARK_FINAL = 2    /* an output: it was in the filter at END */
} plr_landmark_role;

typedef struct plr_landmark_message {
    uint8_t role;          /* plr_landmark_role */
    plr_landmark landmark; /* the frame has no times_gated, and only the lower triangle of P_W_m2; a
                              reader sets known from the role */
} plr_landmark_message;

typedef struct plr_pose_message {
    plr_time_ns t_ns;
    uint8_t real_bytes;   /* 4 or 8: precision of the filter and of the frame (p is always 8) */
    bool after_update;    /* true: after a STEREO; false: after a TWIST */
    uint16_t reset_count; /* times the pose may have jumped: plr_health_state.resets, modulo 2^16 */
    plr_pose T_WB;
    double P_xi[21]; /* covariance of (rho, theta): lower triangle, row by row; m^2, rad^2 */
    plr_twist velocity;
    double bias[6]; /* (b_v, b_w), m/s and rad/s; with an IMU (b_a, b_g), m/s^2 and rad/s */
    double P_u[21]; /* covariance of velocity, in the order (v, w); packed like P_xi */
    double trace;   /* of the whole covariance, landmarks included; negative: not known. Known after
                       a STEREO alone, and not from senders before format 1.3 */
    double bias_variance[6]; /* of bias, in its order; negative: not known, as above. The frame has
                                float32 */
} plr_pose_message;

/* What a REPORT says besides its status. */
typedef enum plr_notice {
    PLR_NOTICE_NONE = 0,
    PLR_NOTICE_STARTED = 1, /* the sender has just started: whatever it was told before is lost */
    PLR_NOTICE_SAVED = 2,   /* the filter's state was saved */
    PLR_NOTICE_RESTORED = 3 /* the filter continues from a saved state */
} plr_notice;

typedef struct plr_report_message {
    uint8_t subject; /* plr_kind of the message that it answers */
    uint8_t notice;  /* plr_notice; those of a later version are passed on */
    plr_report report;
    uint32_t update_us; /* time that the frame took, us; 0 without a clock */
} plr_report_message;

typedef enum plr_severity {
    PLR_SEVERITY_INFO = 0,
    PLR_SEVERITY_WARNING = 1,
    PLR_SEVERITY_ERROR = 2
} plr_severity;

typedef struct plr_text {
    uint8_t severity;                 /* plr_severity */
    char text[PLR_WIRE_MAX_TEXT + 1]; /* UTF-8, ends with a zero; a reader cuts longer texts */
} plr_text;

/* The kinds that END counts by name, as indices. */
typedef enum plr_counted {
    PLR_COUNTED_TWIST,
    PLR_COUNTED_STEREO,
    PLR_COUNTED_TRUTH,
    PLR_COUNTED_LANDMARK,
    PLR_COUNTED_READING,
    PLR_COUNTED_IMU,
    PLR_COUNTED
} plr_counted;

typedef struct plr_end {
    /* How many frames of each kind (plr_counted), and of all kinds, the sender has written before
     * this one. Senders before format 1.3 count no READING, before 1.4 no IMU. */
    uint32_t sent[PLR_COUNTED], frames;
    /* Where this END answers another: bit i is set if of kind i (plr_counted) another number
     * arrived than that END says, and arrived[i] is that number; else it is 0. */
    uint8_t differs;
    uint32_t arrived[PLR_COUNTED];
} plr_end;

typedef enum plr_state_action { PLR_STATE_SAVE = 1, PLR_STATE_RESTORE = 2 } plr_state_action;

/* A request to save the filter's state, or to restore it after a power cut. */
typedef struct plr_state_message {
    plr_time_ns t_ns;         /* RESTORE: when the drive continues; SAVE: repeated in the answer */
    uint8_t action;           /* plr_state_action */
    double moved_variance[6]; /* RESTORE: how far the body may have moved since the save: variances
                                 of (rho, theta), m^2 and rad^2; zeros: it stood still */
} plr_state_message;

typedef enum plr_side { PLR_SIDE_LEFT = 0, PLR_SIDE_RIGHT = 1 } plr_side;

/* A band of one picture: pixels in the order of the rows. The first band has first_px 0, and each of the others
 * goes on where the one before it ended; bands of the two sides may alternate. */
typedef struct plr_image_message {
    plr_time_ns t_ns; /* of the picture's first row */
    uint8_t side;     /* plr_side */
    uint16_t width_px, height_px;
    uint32_t first_px; /* pixels of the picture before this band */
    uint16_t count;    /* pixels of this band, 1 or more */
    const uint8_t *pixels;
} plr_image_message;

/* One message. The observations of a STEREO that was read are in the reader's array, the pixels of an IMAGE
 * in its buffer; both are valid until the next call on the reader. */
typedef struct plr_message {
    plr_kind kind;
    uint16_t sequence;
    union {
        plr_header header;
        plr_config_message config;
        plr_start start;
        plr_twist_message twist;
        plr_frame stereo;
        plr_truth truth;
        plr_landmark_message landmark;
        plr_pose_message pose;
        plr_report_message report;
        plr_text text;
        plr_end end;
        plr_state_message state;
        plr_reading reading;
        plr_imu_message imu;
        plr_supervision evidence;
        plr_calibration_result calibration;
        plr_image_message image;
        plr_rig rig;
    } as;
} plr_message;

/* --- reading --- */

typedef struct plr_reader_counts {
    uint64_t bytes;
    uint32_t frames;    /* good ones */
    uint32_t damaged;   /* CRC, stuffing or length wrong */
    uint32_t unknown;   /* kind not known */
    uint32_t malformed; /* CRC good, payload too short or with an impossible value */
    uint32_t too_long;  /* CRC good, larger than the buffer or the observation array */
    uint32_t missing;   /* frames that the sequence numbers show to be missing, damaged ones too */
} plr_reader_counts;

/* The result of plr_reader_feed. */
typedef enum plr_read_event {
    PLR_READ_MORE = 0,    /* all bytes were used, and no frame is complete */
    PLR_READ_MESSAGE = 1, /* a good message */
    PLR_READ_SKIPPED = 2, /* a frame was skipped: see .skipped_why and .skipped_at */
    PLR_READ_FUTURE = 3   /* a HEADER of a later major version: nothing more can be read */
} plr_read_event;

/* Why a frame was skipped; each is a count in plr_reader_counts. */
typedef enum plr_skip {
    PLR_SKIP_NONE = 0,
    PLR_SKIP_DAMAGED = 1,
    PLR_SKIP_UNKNOWN = 2,
    PLR_SKIP_MALFORMED = 3,
    PLR_SKIP_TOO_LONG = 4
} plr_skip;

/* State of the byte stuffing (COBS) between two bytes. For the library alone. */
typedef struct plr_cobs_decoder {
    uint8_t code; /* of the current block, 0 before the first */
    uint8_t left; /* data bytes until the next code byte */
} plr_cobs_decoder;

typedef struct plr_cobs_encoder {
    uint8_t block[255]; /* code byte and data bytes; at the end, the delimiter */
    uint8_t fill;       /* bytes of the open block with its code byte; 0: no block is open */
} plr_cobs_encoder;

/* A caller may read `counts` and `skipped_*`; the rest is for the library alone. */
typedef struct plr_reader {
    plr_reader_counts counts;
    uint64_t skipped_at;  /* byte offset at which the last skipped frame began */
    plr_skip skipped_why; /* of the last skipped frame */
    uint8_t skipped_kind; /* its kind, if it was not damaged */

    uint8_t *buffer; /* the body of one frame, unstuffed */
    size_t buffer_size;
    plr_observation *observations;
    unsigned max_observations;
    plr_cobs_decoder cobs;
    size_t length; /* bytes of the body in the buffer */
    uint32_t crc;  /* of all bytes of the body so far, those that did not fit included */
    bool overrun;  /* the body is longer than the buffer */
    bool future;   /* a HEADER of a later major version was read */
    uint16_t next_sequence;
    uint64_t frame_start; /* byte offset at which the current frame began */
} plr_reader;

/* Prepares a reader over the caller's buffer (at least PLR_WIRE_MIN_BUFFER bytes) and observation
 * array.
 * PLR_E_ARGUMENT if the buffer is smaller or a pointer is null; without observations
 * (max_observations 0) that pointer may be null, and every STEREO that holds some is too long. */
plr_status plr_reader_init(plr_reader *r, uint8_t *buffer, size_t buffer_size,
                           plr_observation *observations, unsigned max_observations);

/* Processes bytes up to the end of the next frame, and sets *taken to their number. Call it again
 * with the rest. On PLR_READ_MESSAGE *message is filled. On the first PLR_READ_FUTURE it is a
 * HEADER of which only the version is set; every later call uses all bytes, reads nothing and
 * returns PLR_READ_FUTURE. Otherwise message->kind is PLR_KIND_NONE and the rest is undefined. Time
 * is bounded by n and the frame's length. No pointer may be null, except `bytes` where n is 0. */
plr_read_event plr_reader_feed(plr_reader *r, const uint8_t *bytes, size_t n, size_t *taken,
                               plr_message *message);

/* True if the bytes so far end in the middle of a frame; at the end of a file: it is truncated. */
bool plr_reader_mid_frame(const plr_reader *r);

/* --- writing --- */

/* Sends n bytes, 1 to 255. Returns 0; after anything else the writer returns PLR_E_IO. */
typedef int (*plr_write_function)(void *context, const uint8_t *bytes, size_t n);

typedef struct plr_writer {
    plr_write_function write;
    void *context;
    uint16_t sequence;
    uint32_t crc;
    plr_cobs_encoder cobs;
    plr_status status; /* of the frame in progress */
    bool torn;         /* the last frame failed: the next one begins with a delimiter */
    plr_end counts;    /* for END: the frames that were written completely */
} plr_writer;

/* Prepares a writer; `context` is handed to the function and may be null.
 * PLR_E_ARGUMENT if another pointer is. */
plr_status plr_writer_init(plr_writer *w, plr_write_function write, void *context);

/* Writes one message as a frame. The writer supplies the sequence number, the version of a HEADER
 * and what an END counts as sent; those in *message are ignored.
 * PLR_E_ARGUMENT the message holds an impossible value: nothing is written. PLR_E_IO the function
 * failed: the message is lost, and a reader counts it as missing. The next frame then begins with a
 * delimiter, so that it can be read. */
plr_status plr_writer_put(plr_writer *w, const plr_message *message);

/* --- parts, for tests and other links --- */

/* CRC-32 as in zlib. Start with crc = 0; to continue, pass the last result. */
uint32_t plr_crc32(uint32_t crc, const uint8_t *bytes, size_t n);

#ifdef __cplusplus
}
#endif

#endif
