/* A stand-in for the CUDA runtime, and the driver, over host memory.

   An allocation of device memory is a file in a folder, and so is the progress of an event: other
   processes can open them, and the harness can read and write them. Work on a stream is done at
   once. Every call that matters leaves a line in a trace. Error codes are those of runtime 13.0
   on an H200. */

#ifndef OBJECTS_H
#define OBJECTS_H
#define _GNU_SOURCE
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define API __attribute__((visibility("default")))
#define ERRORS(E)                                                                               \
    E(SUCCESS, 0, "cudaSuccess", "no error")                                                    \
    E(INVALID_VALUE, 1, "cudaErrorInvalidValue", "invalid argument")                            \
    E(OUT_OF_MEMORY, 2, "cudaErrorMemoryAllocation", "out of memory")                           \
    E(BAD_PITCH, 12, "cudaErrorInvalidPitchValue", "invalid pitch argument")                    \
    E(BAD_KIND, 21, "cudaErrorInvalidMemcpyDirection", "invalid copy direction for memcpy")     \
    E(INVALID_DEVICE, 101, "cudaErrorInvalidDevice", "invalid device ordinal")                  \
    E(OWN_HANDLE, 201, "cudaErrorDeviceUninitialized", "invalid device context")                \
    E(NO_EVENT, 205, "cudaErrorMapBufferObjectFailed", "mapping of buffer object failed")       \
    E(INVALID_RESOURCE, 400, "cudaErrorInvalidResourceHandle", "invalid resource handle")       \
    E(NOT_READY, 600, "cudaErrorNotReady", "device not ready")                                  \
    E(TIMEOUT, 702, "cudaErrorLaunchTimeout", "the launch timed out and was terminated")
#define ERROR_CODE(symbol, code, name, text) symbol = code,
enum error { ERRORS(ERROR_CODE) };

#define MOST_BYTES ((size_t)1 << 38) /* of an allocation */

enum kind { ALLOCATED = 1, IMPORTED = 2, PINNED = 4, EVENT = 8, STREAM = 16 };
enum { DEVICE_MEMORY = ALLOCATED | IMPORTED, MEMORY = DEVICE_MEMORY | PINNED };

struct object {
    struct object *next;
    enum kind kind;
    char name[17];
    int exporter; /* process */
    size_t size;
    char *bytes;     /* where the file is mapped */
    char *address;   /* what the program sees of memory: device memory is closed to the host */
    unsigned opened; /* times */
    unsigned flags;  /* of an event */
    int number;      /* of a stream */
    double at;       /* seconds, when an event was last recorded */
};

struct progress { /* of an event, in its file: count of its records, and the last that is done */
    uint64_t recorded, completed;
};

struct handle { /* a cudaIpcMemHandle_t or cudaIpcEventHandle_t */
    char bytes[64];
};

extern _Thread_local int last_error, device;
extern const int is_the_driver __attribute__((weak, visibility("hidden"))); /* NULL if it is not */

/* Take the lock when a call begins; give it back when it ends, with a line in the trace that
   `format` adds JSON members to. `leave` returns the code that it is given. */
void enter(void);
int leave(const char *call, int code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
void let_others_in(void);
void load(void); /* tell the trace, once, that a program uses this */
double now(void);

struct object *first(void);
struct object *containing(const void *pointer); /* memory that it points into */
struct object *known(const void *object, unsigned kinds);
struct object *create(enum kind kind, size_t size); /* NULL if there is no room */
void drop(struct object *object);
void write_handle(struct handle *handle, const struct object *object);
int import(const struct handle *handle, enum kind kind, struct object **object);
int is_stream(const void *stream);
int number_of(const void *stream);
#endif
