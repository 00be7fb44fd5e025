/* A viewer without its window: copies images out of CUDA memory, sends a camera that goes round. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <math.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

typedef struct { char bytes[64]; } Handle;
typedef void *Event, *Stream;
int cudaSetDevice(int);
int cudaIpcOpenMemHandle(void **, Handle, unsigned);
int cudaIpcCloseMemHandle(void *);
int cudaIpcOpenEventHandle(Event *, Handle);
int cudaEventDestroy(Event);
int cudaStreamCreate(Stream *);
int cudaStreamDestroy(Stream);
int cudaStreamWaitEvent(Stream, Event, unsigned);
int cudaStreamSynchronize(Stream);
int cudaMemcpy2DAsync(void *, size_t, const void *, size_t, size_t, size_t, int, Stream);
#ifndef START_SECONDS
#define START_SECONDS 3 /* as long as a scene takes to load */
#define CUDA_SECONDS 0
#endif
enum { TO_HOST = 2, MOST = 1 << 20, DEEPEST = 64 };

/* ---- JSON: a tree in one block of nodes; 0 where the text is not what it should be ---- */
enum Kind { NIL, BOOLEAN, NUMBER, STRING, ARRAY, OBJECT };
typedef struct Node {
    enum Kind kind;
    double number;
    char *name, *text; /* unescaped, in the packet itself */
    size_t name_length, length;
    struct Node *child, *next;
} Node;
typedef struct { char *at, *end; Node *nodes; int used, room; } Reader;

static void blank(Reader *r) { while (r->at < r->end && strchr(" \t\r\n", *r->at) && *r->at) r->at++; }
static int next_is(Reader *r, char c) { blank(r); return r->at < r->end && *r->at == c; }
static int hex4(Reader *r, unsigned *value) {
    if (r->end - r->at < 4) return 0;
    *value = 0;
    for (int i = 0; i < 4; i++) {
        const char *digits = "0123456789abcdef", *d = strchr(digits, *r->at | 32);
        if (!*r->at || !d || (*r->at < '0')) return 0;
        *value = *value * 16 + (unsigned)(d - digits);
        r->at++;
    }
    return 1;
}
static char *put(char *to, unsigned code) {
    if (code < 0x80) { *to++ = (char)code; return to; }
    if (code < 0x800) *to++ = (char)(0xC0 | code >> 6);
    else {
        if (code < 0x10000) *to++ = (char)(0xE0 | code >> 12);
        else { *to++ = (char)(0xF0 | code >> 18); *to++ = (char)(0x80 | (code >> 12 & 63)); }
        *to++ = (char)(0x80 | (code >> 6 & 63));
    }
    *to++ = (char)(0x80 | (code & 63));
    return to;
}
static int string(Reader *r, char **text, size_t *length) {
    if (!next_is(r, '"')) return 0;
    char *to = *text = ++r->at;
    while (r->at < r->end && *r->at != '"') {
        if ((unsigned char)*r->at < 0x20) return 0;
        if (*r->at != '\\') { *to++ = *r->at++; continue; }
        if (++r->at == r->end) return 0;
        const char *from = "\"\\/bfnrt", *is = "\"\\/\b\f\n\r\t", *found = strchr(from, *r->at);
        if (*r->at && found) { *to++ = is[found - from]; r->at++; continue; }
        unsigned code, low;
        if (*r->at++ != 'u' || !hex4(r, &code)) return 0;
        if (code >= 0xDC00 && code < 0xE000) return 0;
        if (code >= 0xD800 && code < 0xDC00) {
            if (r->end - r->at < 6 || *r->at++ != '\\' || *r->at++ != 'u' || !hex4(r, &low)) return 0;
            if (low < 0xDC00 || low > 0xDFFF) return 0;
            code = 0x10000 + ((code - 0xD800) << 10) + (low - 0xDC00);
        }
        to = put(to, code);
    }
    if (r->at >= r->end) return 0;
    *length = (size_t)(to - *text);
    r->at++;
    return 1;
}
static int digits(Reader *r) {
    char *from = r->at;
    while (r->at < r->end && *r->at >= '0' && *r->at <= '9') r->at++;
    return r->at > from;
}
static int number(Reader *r, Node *node) {
    char *from = r->at;
    if (r->at < r->end && *r->at == '-') r->at++;
    if (r->at < r->end && *r->at == '0') r->at++;
    else if (!digits(r)) return 0;
    if (r->at < r->end && *r->at == '.') { r->at++; if (!digits(r)) return 0; }
    if (r->at < r->end && (*r->at | 32) == 'e') {
        r->at++;
        if (r->at < r->end && (*r->at == '+' || *r->at == '-')) r->at++;
        if (!digits(r)) return 0;
    }
    node->kind = NUMBER;
    node->number = strtod(from, NULL); /* stops where we did: the packet ends with a zero */
    return isfinite(node->number);
}
static Node *value(Reader *r, int depth) {
    blank(r);
    if (r->used == r->room || r->at >= r->end) return NULL;
    Node *node = &r->nodes[r->used++], **last = &node->child;
    memset(node, 0, sizeof *node);
    if (*r->at == '"') { node->kind = STRING; return string(r, &node->text, &node->length) ? node : NULL; }
    if (*r->at != '{' && *r->at != '[') {
        static const char *words[] = {"null", "true", "false"};
        for (int i = 0; i < 3; i++) {
            size_t n = strlen(words[i]);
            if ((size_t)(r->end - r->at) >= n && !memcmp(r->at, words[i], n)) {
                node->kind = i ? BOOLEAN : NIL;
                r->at += n;
                return node;
            }
        }
        return number(r, node) ? node : NULL;
    }
    char close = *r->at++ == '{' ? '}' : ']';
    node->kind = close == '}' ? OBJECT : ARRAY;
    if (depth > DEEPEST) return NULL;
    if (next_is(r, close)) { r->at++; return node; }
    for (;;) {
        char *name = NULL;
        size_t length = 0;
        if (close == '}') {
            if (!string(r, &name, &length) || !next_is(r, ':')) return NULL;
            r->at++;
            for (Node *other = node->child; other; other = other->next)
                if (other->name_length == length && !memcmp(other->name, name, length)) return NULL;
        }
        Node *child = value(r, depth + 1);
        if (!child) return NULL;
        child->name = name;
        child->name_length = length;
        *last = child;
        last = &child->next;
        if (next_is(r, ',')) { r->at++; continue; }
        if (!next_is(r, close)) return NULL;
        r->at++;
        return node;
    }
}
static int utf8(const unsigned char *s, const unsigned char *end) {
    while (s < end) {
        unsigned more = *s < 0x80 ? 0 : *s >= 0xC2 && *s < 0xE0 ? 1 : *s >= 0xE0 && *s < 0xF0 ? 2 : *s >= 0xF0 && *s < 0xF5 ? 3 : 9;
        if (more == 9 || s + more >= end) return 0;
        if ((*s == 0xE0 && s[1] < 0xA0) || (*s == 0xED && s[1] > 0x9F)) return 0;
        if ((*s == 0xF0 && s[1] < 0x90) || (*s == 0xF4 && s[1] > 0x8F)) return 0;
        for (s++; more; more--, s++) if ((*s & 0xC0) != 0x80) return 0;
    }
    return 1;
}
static Node *object(Reader *r, char *payload, size_t length) {
    *r = (Reader){payload, payload + length, malloc((length + 1) * sizeof(Node)), 0, (int)length + 1};
    if (!r->nodes || !utf8((unsigned char *)payload, (unsigned char *)payload + length)) return NULL;
    Node *root = value(r, 1);
    blank(r);
    return root && r->at == r->end && root->kind == OBJECT ? root : NULL;
}
static Node *member(Node *of, const char *name, enum Kind kind) {
    for (Node *each = of ? of->child : NULL; each; each = each->next)
        if (each->name_length == strlen(name) && !memcmp(each->name, name, each->name_length))
            return each->kind == kind || kind == NIL ? each : NULL;
    return NULL;
}

/* ---- one connection ---- */
typedef struct { int socket; char *buffer; size_t have; double since; } Line;

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}
static void rest(double seconds) { if (seconds > 0) usleep((useconds_t)(seconds * 1e6)); }
static Line meet(const char *variable, int usual) {
    const char *host = getenv("SPLATBUS_HOST"), *port = getenv(variable);
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons((uint16_t)(port ? atoi(port) : usual))};
    inet_pton(AF_INET, host ? host : "127.0.0.1", &to.sin_addr);
    for (double pause = 0.125;; pause = pause < 4 ? 2 * pause : 4) {
        double begun = now();
        int one = 1, s = socket(AF_INET, SOCK_STREAM, 0);
        if (!connect(s, (struct sockaddr *)&to, sizeof to)) {
            setsockopt(s, IPPROTO_TCP, TCP_NODELAY, &one, sizeof one);
            return (Line){s, malloc(MOST + 5), 0, 0};
        }
        close(s);
        rest(begun + pause - now());
    }
}
/* 1 and a packet, with a zero behind it; 0 when none came in time; −1 when the connection is over */
static int packet(Line *l, double seconds, char **payload, size_t *length) {
    double until = now() + seconds;
    for (;;) {
        uint32_t n = 0;
        memcpy(&n, l->buffer, 4);
        if (l->have >= 4 && (n < 1 || n > MOST)) return -1;
        if (l->have >= 4 && l->have >= 4 + (size_t)n) {
            *payload = malloc(n + 1);
            memcpy(*payload, l->buffer + 4, n);
            (*payload)[n] = 0;
            *length = n;
            memmove(l->buffer, l->buffer + 4 + n, l->have -= 4 + n);
            l->since = now();
            return 1;
        }
        double left = until - now();
        if (l->have && now() > l->since + 10) return -1;
        struct pollfd p = {l->socket, POLLIN, 0};
        if (poll(&p, 1, left > 0 ? (int)(left * 1000) + 1 : 0) <= 0) return 0;
        ssize_t got = recv(l->socket, l->buffer + l->have, MOST + 4 - l->have, 0);
        if (got <= 0) return -1;
        if (!l->have) l->since = now();
        l->have += (size_t)got;
    }
}
static void hang_up(Line *l) { close(l->socket); free(l->buffer); }

/* ---- images ---- */
typedef struct { size_t w, h, colour_at, depth_at; int device; Handle colour, depth, done; } Packet;

static int whole(Node *of, const char *name, double least, double most, double *value) {
    Node *n = member(of, name, NIL);
    if (!n) return -1;
    if (n->kind != NUMBER || floor(n->number) != n->number || n->number < least || n->number > most) return 0;
    *value = n->number;
    return 1;
}
static int handle(Node *root, const char *name, Handle *to) {
    const char *letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/", *at;
    Node *n = member(root, name, STRING);
    if (!n || n->length != 88 || n->text[86] != '=' || n->text[87] != '=') return 0;
    uint32_t bits = 0;
    for (int i = 0, got = 0, out = 0; i < 86; i++) {
        if (!n->text[i] || !(at = strchr(letters, n->text[i]))) return 0;
        bits = bits << 6 | (uint32_t)(at - letters);
        if ((got += 6) >= 8) { got -= 8; to->bytes[out++] = (char)(bits >> got); }
    }
    return 1;
}
static int is(Node *of, const char *name, const char *text) {
    Node *n = member(of, name, STRING);
    return n && n->length == strlen(text) && !memcmp(n->text, text, n->length);
}
static int describes(Node *root, Packet *p) {
    Node *meta = member(root, "meta", OBJECT);
    double w, h, pitch_colour, pitch_depth, colour = 0, depth = 0, device = 0, safe = 9007199254740991.0;
    if (!meta || member(root, "type", NIL)) return 0;
    if (whole(meta, "w", 1, 32768, &w) < 1 || whole(meta, "h", 1, 32768, &h) < 1) return 0;
    if (whole(meta, "pitchColor", 16 * w, 16 * w, &pitch_colour) < 1) return 0;
    if (whole(meta, "pitchDepth", 4 * w, 4 * w, &pitch_depth) < 1) return 0;
    if (!whole(meta, "offsetColor", 0, safe, &colour) || fmod(colour, 16)) return 0;
    if (!whole(meta, "offsetDepth", 0, safe, &depth) || fmod(depth, 4)) return 0;
    if (!whole(meta, "device", 0, safe, &device)) return 0;
    if (!is(meta, "fmtColor", "RGBA32F") || !is(meta, "fmtDepth", "R32F")) return 0;
    *p = (Packet){(size_t)w, (size_t)h, (size_t)colour, (size_t)depth, device > 1e9 ? -1 : (int)device, {{0}}, {{0}}, {{0}}};
    return handle(root, "mem_color", &p->colour) && handle(root, "mem_depth", &p->depth) && handle(root, "evt_done", &p->done);
}
/* Copies images until the connection is over; what comes meanwhile is read and passed over. */
static void show(Line *l, Packet *p) {
    char *colour = NULL, *depth = NULL, *payload;
    size_t length, pixels = p->w * p->h;
    Event done = NULL;
    Stream stream = NULL;
    float *image = malloc(pixels * 16), *distance = malloc(pixels * 4);
    int shared = !memcmp(&p->colour, &p->depth, sizeof(Handle)), came;
    sleep(CUDA_SECONDS); /* until the driver is there; each process shows images once */
    int good = image && distance && !cudaSetDevice(p->device) && !cudaStreamCreate(&stream)
        && !cudaIpcOpenMemHandle((void **)&colour, p->colour, 1)
        && (shared ? (depth = colour) != NULL : !cudaIpcOpenMemHandle((void **)&depth, p->depth, 1))
        && !cudaIpcOpenEventHandle(&done, p->done);
    fprintf(stderr, good ? "showing %zu x %zu\n" : "cannot open %zu x %zu\n", p->w, p->h);
    while ((came = packet(l, 0.02, &payload, &length)) >= 0) {
        if (came) free(payload);
        if (!good) continue;
        good = !cudaStreamWaitEvent(stream, done, 0)
            && !cudaMemcpy2DAsync(image, 16 * p->w, colour + p->colour_at, 16 * p->w, 16 * p->w, p->h, TO_HOST, stream)
            && !cudaMemcpy2DAsync(distance, 4 * p->w, depth + p->depth_at, 4 * p->w, 4 * p->w, p->h, TO_HOST, stream)
            && !cudaStreamSynchronize(stream);
    }
    if (stream) { cudaStreamSynchronize(stream); cudaStreamDestroy(stream); }
    if (colour) cudaIpcCloseMemHandle(colour);
    if (depth && !shared) cudaIpcCloseMemHandle(depth);
    if (done) cudaEventDestroy(done);
    free(image);
    free(distance);
}
static void *images(void *unused) {
    Line line = meet("SPLATBUS_IPC_PORT", 6001);
    char *payload;
    size_t length;
    for (int came; (came = packet(&line, 1, &payload, &length)) >= 0;) {
        Reader reader = {0};
        Packet p;
        int good = came && describes(object(&reader, payload, length), &p);
        if (came) { free(reader.nodes); free(payload); }
        if (good) { show(&line, &p); break; }
    }
    hang_up(&line);
    return unused;
}

/* ---- the camera ---- */
static int say(Line *l, const char *text) {
    char whole[1024];
    uint32_t n = (uint32_t)strlen(text);
    memcpy(whole, &n, 4);
    memcpy(whole + 4, text, n);
    return send(l->socket, whole, n + 4, MSG_NOSIGNAL) == (ssize_t)n + 4;
}
static int numbers(Node *array, int count, double *to) {
    Node *each = array ? array->child : NULL;
    for (int i = 0; i < count; i++, each = each->next) {
        if (!each || each->kind != NUMBER || fabs(each->number) > 3.4028234663852886e38) return 0;
        to[i] = each->number;
    }
    return !each;
}
static void steer(Line *l) {
    char *payload, text[900];
    size_t length;
    double c[3], q[4], asked = now();
    if (!say(l, "{\"type\":\"get_camera_pose\",\"cam_idx\":0}")) return;
    for (int came = 0; !came;) {
        Reader reader = {0};
        if ((came = packet(l, 0.5, &payload, &length)) < 0 || now() > asked + 9) return;
        if (!came) continue;
        Node *reply = object(&reader, payload, length);
        int good = numbers(member(reply, "position", ARRAY), 3, c) && numbers(member(reply, "rotation", ARRAY), 4, q)
            && fabs(sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]) - 1) <= 0.01;
        free(reader.nodes);
        free(payload);
        if (!good) return;
    }
    for (double turn = 0;; turn += 0.01) {
        snprintf(text, sizeof text,
                 "{\"type\":\"camera_pose\",\"timestamp\":%.17g,\"position\":{\"x\":%.17g,\"y\":%.17g,\"z\":%.17g},"
                 "\"rotation\":{\"x\":0,\"y\":%.17g,\"z\":0,\"w\":%.17g}}",
                 now(), c[0] + sin(turn) / 2, c[1], c[2], sin(turn / 2), cos(turn / 2));
        int came = say(l, text) ? packet(l, 0.02, &payload, &length) : -1;
        if (came < 0) return;
        if (came) free(payload);
    }
}
int main(void) {
    pthread_t reader;
    sleep(START_SECONDS);
    pthread_create(&reader, NULL, images, NULL);
    Line line = meet("SPLATBUS_MSG_PORT", 6000);
    steer(&line);
    hang_up(&line);
    for (;;) pause(); /* until somebody closes the window */
}
