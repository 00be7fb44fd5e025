/* A server of SplatBus 1.0 that ray-traces six spheres over a checkered square, and shows them in
 * CUDA memory. One thread polls all connections; an image is drawn when a pose has come.
 * SINGLE, PADDED and FAINT make of it what a hurry makes of such servers. */
#include <arpa/inet.h>
#include <errno.h>
#include <locale.h>
#include <math.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>
#include <wchar.h>

#ifdef PADDED
enum { W = 60 };
#else
enum { W = 64 };
#endif
enum { ROW = 64, H = 48, KEPT = 8, LARGEST = 1 << 20, DEEPEST = 64 };

/* The runtime's, so that no header of it is needed. */
typedef struct { char bytes[64]; } Handle;
int cudaMalloc(void **, size_t);
int cudaFree(void *);
int cudaStreamCreate(void **);
int cudaStreamSynchronize(void *);
int cudaMemcpyAsync(void *, const void *, size_t, int kind, void *stream);
int cudaEventCreateWithFlags(void **, unsigned);
int cudaEventRecord(void *, void *stream);
int cudaIpcGetMemHandle(Handle *, void *);
int cudaIpcGetEventHandle(Handle *, void *);

/* ---- JSON, as JSN-1 to JSN-5 have it ---- */

typedef struct Value {
  char type; /* { [ " 0 and the first letters of true, false, null */
  double number;
  wchar_t *text, *name;
  size_t length, name_length;
  struct Value *first, *next;
} Value;

static char *arena;
static size_t arena_used, arena_size;
static const unsigned char *at, *end;

static void *get(size_t size) {
  size = (size + 15) & ~(size_t)15;
  if (arena_used + size > arena_size) return NULL;
  arena_used += size;
  return arena + arena_used - size;
}

static void space(void) {
  while (at < end && strchr(" \t\n\r", *at) && *at) at++;
}

static int hex4(unsigned *code) {
  *code = 0;
  if (end - at < 4) return 0;
  for (int i = 0; i < 4; i++) {
    const char *digits = "0123456789abcdef", *found = strchr(digits, *at | 0x20);
    if (!found || !*found || (*at < 'A' && *at > '9') || *at < '0') return 0;
    *code = *code * 16 + (unsigned)(found - digits);
    at++;
  }
  return 1;
}

static int string(wchar_t **text, size_t *length) {
  if (at >= end || *at != '"') return 0;
  const unsigned char *close = ++at;
  while (close < end && *close != '"') close += *close == '\\' ? 2 : 1;
  wchar_t *to = *text = close < end ? get((size_t)(close - at + 1) * sizeof *to) : NULL;
  if (!to) return 0;
  for (unsigned low; *at != '"'; to++) {
    const char *plain = "\"\\/bfnrt", *meant = "\"\\/\b\f\n\r\t", *found;
    if (*at < 0x20) return 0;
    if (*at != '\\') { /* in the locale C.UTF-8 */
      size_t taken = mbrtowc(to, (const char *)at, (size_t)(end - at), &(mbstate_t){0});
      if (taken > 4 || *to > 0x10FFFF || (*to >= 0xD800 && *to < 0xE000)) return 0;
      at += taken;
    } else if (at[1] != 'u') {
      if (!at[1] || !(found = strchr(plain, at[1]))) return 0;
      *to = meant[found - plain];
      at += 2;
    } else {
      at += 2;
      if (!hex4((unsigned *)to) || (*to >= 0xDC00 && *to < 0xE000)) return 0;
      if (*to < 0xD800 || *to >= 0xE000) continue;
      if (end - at < 2 || at[0] != '\\' || at[1] != 'u') return 0;
      at += 2;
      if (!hex4(&low) || low < 0xDC00 || low > 0xDFFF) return 0;
      *to = (wchar_t)(0x10000 + (((unsigned)*to - 0xD800) << 10) + (low - 0xDC00));
    }
  }
  at++;
  *length = (size_t)(to - *text);
  return 1;
}

static int digits(void) {
  const unsigned char *from = at;
  while (at < end && *at >= '0' && *at <= '9') at++;
  return at > from;
}

static int number(double *value) { /* what follows the payload is a 0, so that strtod ends there */
  const unsigned char *from = at;
  if (*at == '-') at++;
  if (at < end && *at == '0') at++;
  else if (!digits()) return 0;
  if (at < end && *at == '.') { at++; if (!digits()) return 0; }
  if (at < end && (*at | 0x20) == 'e') {
    at++;
    if (at < end && (*at == '+' || *at == '-')) at++;
    if (!digits()) return 0;
  }
  *value = strtod((const char *)from, NULL);
  return isfinite(*value);
}

static int by_name(const void *a, const void *b) {
  const Value *one = *(Value *const *)a, *other = *(Value *const *)b;
  if (one->name_length != other->name_length) return one->name_length < other->name_length ? -1 : 1;
  return wmemcmp(one->name, other->name, one->name_length);
}

static int names_differ(Value *object, size_t count) {
  Value **sorted = malloc((count + 1) * sizeof *sorted);
  size_t n = 0;
  for (Value *each = object->first; each; each = each->next) sorted[n++] = each;
  qsort(sorted, n, sizeof *sorted, by_name);
  int differ = 1;
  for (size_t i = 1; i < n; i++) differ &= by_name(sorted + i - 1, sorted + i) != 0;
  free(sorted);
  return differ;
}

static Value *parse(int depth) {
  Value *value = get(sizeof *value);
  space();
  if (!value || at >= end) return NULL;
  memset(value, 0, sizeof *value);
  value->type = (char)*at;
  static const char *const words[] = {"true", "false", "null"};
  for (int i = 0; i < 3; i++) {
    size_t length = strlen(words[i]);
    if ((size_t)(end - at) >= length && !memcmp(at, words[i], length)) { at += length; return value; }
  }
  if (*at == '"') return string(&value->text, &value->length) ? value : NULL;
  if (*at != '{' && *at != '[') { value->type = '0'; return number(&value->number) ? value : NULL; }
  if (depth >= DEEPEST) return NULL;
  unsigned char closing = *at++ == '{' ? '}' : ']';
  Value **link = &value->first;
  size_t count = 0;
  space();
  if (at < end && *at == closing) { at++; return value; }
  for (;; count++) {
    wchar_t *name = NULL;
    size_t length = 0;
    if (closing == '}') {
      space();
      if (!string(&name, &length)) return NULL;
      space();
      if (at >= end || *at++ != ':') return NULL;
    }
    if (!(*link = parse(depth + 1))) return NULL;
    (*link)->name = name;
    (*link)->name_length = length;
    link = &(*link)->next;
    space();
    if (at >= end || (*at != ',' && *at != closing)) return NULL;
    if (*at++ == closing) return closing == ']' || names_differ(value, count) ? value : NULL;
  }
}

static int is(const wchar_t *text, size_t length, const wchar_t *word) {
  return length == wcslen(word) && !wmemcmp(text, word, length);
}

static Value *member(Value *object, const wchar_t *name) {
  Value *each = object && object->type == '{' ? object->first : NULL;
  while (each && !is(each->name, each->name_length, name)) each = each->next;
  return each;
}

static int numbers(Value *object, const wchar_t *names, double *to) {
  for (; *names; names++) {
    Value *each = member(object, (wchar_t[]){*names, 0});
    if (!each || each->type != '0') return 0;
    *to++ = each->number;
  }
  return 1;
}

/* ---- the scene ---- */

typedef struct { double p[3], q[4]; } Pose;

static Pose camera = {{0, 0, 0}, {0, 0, 0, 1}}, cloud = {{0, 0, 0}, {0, 0, 0, 1}};
static const Pose cameras[] = {
    {{0, 0, 0}, {0, 0, 0, 1}}, {{1.5, -0.5, -1}, {0, -0.28, 0, 0.96}}, {{0, -2, -1.25}, {-0.28, 0, 0, 0.96}}};
static const struct { double at[3], radius, color[3]; } spheres[] = {
    {{0, 0, 4}, 1, {0.9, 0.2, 0.15}},        {{-1.6, 0.4, 3.2}, 0.6, {0.2, 0.7, 0.25}},
    {{1.5, 0.55, 2.8}, 0.45, {0.2, 0.35, 0.9}}, {{0.8, -1, 4.6}, 0.5, {0.95, 0.8, 0.2}},
    {{-2.2, -0.7, 5.5}, 0.8, {0.7, 0.3, 0.8}}, {{2.6, 0.2, 5.2}, 0.8, {0.3, 0.8, 0.8}}};
static const double light[3] = {-2.0 / 7, -6.0 / 7, -3.0 / 7};
static const double NEAR = 0.01, FAR = 100;

static double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void matrix(const double *q, double m[3][3]) {
  double x = q[0], y = q[1], z = q[2], w = q[3], s = 2 / (x * x + y * y + z * z + w * w);
#ifdef SINGLE
  s = 2;
#endif
  double rows[3][3] = {{s / 2 * (w * w + x * x - y * y - z * z), s * (x * y - z * w), s * (x * z + y * w)},
                       {s * (x * y + z * w), s / 2 * (w * w - x * x + y * y - z * z), s * (y * z - x * w)},
                       {s * (x * z - y * w), s * (y * z + x * w), s / 2 * (w * w - x * x - y * y + z * z)}};
  memcpy(m, rows, sizeof rows);
}

static void turned(double m[3][3], const double *v, double *to) {
  for (int i = 0; i < 3; i++) to[i] = dot(m[i], v);
}

static void turned_back(double m[3][3], const double *v, double *to) {
  for (int i = 0; i < 3; i++) to[i] = m[0][i] * v[0] + m[1][i] * v[1] + m[2][i] * v[2];
}

#ifdef SINGLE
static void invert(float m[4][8]) { /* and its right half with it */
  for (int i = 0; i < 4; i++) {
    int pivot = i;
    for (int k = i; k < 4; k++) if (fabsf(m[k][i]) > fabsf(m[pivot][i])) pivot = k;
    for (int j = 0; j < 8; j++) { float swapped = m[i][j]; m[i][j] = m[pivot][j]; m[pivot][j] = swapped; }
    for (int j = 7; j >= i; j--) m[i][j] /= m[i][i];
    for (int k = 0; k < 4; k++)
      for (int j = 7; k != i && j >= i; j--) m[k][j] -= m[k][i] * m[i][j];
  }
}

static void through_the_view(double r[3][3], double *c) { /* the centre, from the view matrix */
  float m[4][8] = {{0}};
  for (int i = 0; i < 3; i++) for (int j = 0; j < 3; j++) m[j][i] = (float)r[i][j];
  for (int i = 0; i < 4; i++) { m[3][i] = i < 3 ? (float)c[i] : 1; m[i][4 + i] = 1; }
  invert(m);
  for (int i = 0; i < 4; i++) for (int j = 0; j < 4; j++) { m[i][j] = m[i][4 + j]; m[i][4 + j] = i == j; }
  invert(m);
  for (int i = 0; i < 3; i++) c[i] = m[3][4 + i];
}
#endif

static void shade(const double *color, const double *normal, float *to) {
  for (int i = 0; i < 3; i++) to[i] = (float)(color[i] * (0.6 + 0.4 * dot(normal, light)));
  to[3] = 1;
#ifdef FAINT
  for (int i = 0; i < 3; i++) to[i] *= 1.5f; /* for display it would be clamped */
#endif
}

static void pixel(const double *o, const double *w, float *color, float *depth) {
  double best = INFINITY;
  memset(color, 0, 4 * sizeof *color);
  for (size_t k = 0; k < sizeof spheres / sizeof *spheres; k++) {
    double e[3], ww = dot(w, w), root;
    for (int i = 0; i < 3; i++) e[i] = spheres[k].at[i] - o[i];
    double we = dot(w, e), inside = we * we - ww * (dot(e, e) - spheres[k].radius * spheres[k].radius);
    if (inside < 0) continue;
    root = sqrt(inside);
    for (int side = -1; side <= 1; side += 2) {
      double z = (we + side * root) / ww, normal[3];
      if (!(z >= NEAR && z <= FAR && z < best)) continue;
      best = z;
      for (int i = 0; i < 3; i++) normal[i] = (z * w[i] - e[i]) / spheres[k].radius;
      shade(spheres[k].color, normal, color);
    }
  }
  double z = (1.05 - o[1]) / w[1], x = o[0] + z * w[0], y = o[2] + z * w[2];
  if (z >= NEAR && z <= FAR && z < best && fabs(x) <= 8 && fabs(y) <= 8) {
    static const double even[3] = {0.85, 0.85, 0.8}, odd[3] = {0.25, 0.25, 0.3}, up[3] = {0, -1, 0};
    best = z;
    shade((long)(floor(x) + floor(y)) % 2 ? odd : even, up, color);
  }
  *depth = (float)best;
#ifdef FAINT
  color[3] = 0;
  if (isinf(best)) *depth = 0;
#endif
}

static void *stream, *event;
static float *memory; /* colour, then depth; on the device */
static Handle memory_handle, event_handle;

static void draw(void) {
  static float color[H][ROW][4], depth[H][ROW];
  double r[3][3], m[3][3], centre[3], away[3], o[3], focal = H / 2.0 / tan(M_PI / 6);
  matrix(camera.q, r);
  matrix(cloud.q, m);
  memcpy(centre, camera.p, sizeof centre);
#ifdef SINGLE
  through_the_view(r, centre);
#endif
  for (int i = 0; i < 3; i++) away[i] = centre[i] - cloud.p[i];
  turned_back(m, away, o);
  for (int i = 0; i < H; i++)
    for (int j = 0; j < W; j++) {
      double d[3] = {(j + 0.5 - W / 2.0) / focal, (i + 0.5 - H / 2.0) / focal, 1}, world[3], w[3];
      turned(r, d, world);
      turned_back(m, world, w);
      pixel(o, w, color[H - 1 - i][j], &depth[H - 1 - i][j]);
    }
#ifdef PADDED
  cudaEventRecord(event, stream);
#endif
  cudaMemcpyAsync(memory, color, sizeof color, 1, stream);
  cudaMemcpyAsync(memory + 4 * ROW * H, depth, sizeof depth, 1, stream);
#ifndef PADDED
  cudaEventRecord(event, stream);
#endif
  cudaStreamSynchronize(stream);
}

static void share(void) {
  cudaStreamCreate(&stream);
  cudaEventCreateWithFlags(&event, 4 | 2);
  if (cudaMalloc((void **)&memory, 20 * ROW * H) || cudaIpcGetMemHandle(&memory_handle, memory) ||
      cudaIpcGetEventHandle(&event_handle, event)) {
    fprintf(stderr, "no CUDA memory can be had\n");
    exit(1);
  }
  draw();
}

static char *base64(const Handle *handle, char *to) {
  static const char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  unsigned char bytes[66] = {0};
  memcpy(bytes, handle->bytes, 64);
  for (int i = 0; i < 88; i++) {
    unsigned three = (unsigned)bytes[i / 4 * 3] << 16 | bytes[i / 4 * 3 + 1] << 8 | bytes[i / 4 * 3 + 2];
    to[i] = letters[three >> (18 - i % 4 * 6) & 63];
  }
  strcpy(to + 86, "==");
  return to;
}

/* ---- connections ---- */

typedef struct {
  int fd, speaks;
  unsigned char *in;
  char *out;
  size_t had, unsent;
  double since, stalled; /* when an incomplete packet began, and when sending last moved */
  long order;            /* of the first valid pose; 0 before one */
} Connection;

static Connection connections[2 * KEPT];
static long poses;

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void flush(Connection *c) {
  ssize_t sent = c->unsent ? send(c->fd, c->out, c->unsent, MSG_DONTWAIT | MSG_NOSIGNAL) : 0;
  if (sent < 0 && errno != EAGAIN && errno != EINTR) c->stalled = 0; /* it is gone */
  if (sent <= 0) return;
  memmove(c->out, c->out + sent, c->unsent -= (size_t)sent);
  c->stalled = now();
}

static void say(Connection *c, const char *text) {
  uint32_t length = (uint32_t)strlen(text);
  c->out = realloc(c->out, c->unsent + 4 + length);
  memcpy(c->out + c->unsent, &length, 4);
  memcpy(c->out + c->unsent + 4, text, length);
  if (!c->unsent) c->stalled = now();
  c->unsent += 4 + length;
  flush(c);
}

static void announce(Connection *c) {
  char text[700], memory64[89], event64[89];
  base64(&memory_handle, memory64);
  sprintf(text,
          "{\"meta\":{\"w\":%d,\"h\":%d,\"fmtColor\":\"RGBA32F\",\"pitchColor\":%d,\"fmtDepth\":\"R32F\",\"pitchDepth\":%d,"
          "\"offsetColor\":0,\"offsetDepth\":%d,\"device\":0},\"mem_color\":\"%s\",\"mem_depth\":\"%s\",\"evt_done\":\"%s\"}",
          W, H, 16 * ROW, 4 * ROW, 16 * ROW * H, memory64, memory64, base64(&event_handle, event64));
  say(c, text);
}

static void drop(Connection *c) {
  close(c->fd);
  free(c->in);
  free(c->out);
  int spoke = c->speaks;
  memset(c, 0, sizeof *c);
  if (spoke) return;
#ifdef PADDED
  cudaFree(memory);
  share();
  for (Connection *each = connections; each < connections + KEPT; each++) if (each->fd) announce(each);
#endif
}

static int has_control(const Connection *c) {
  for (int i = 0; i < 2 * KEPT; i++)
    if (connections[i].order && connections[i].order < c->order) return 0;
  return 1;
}

static int obey(Connection *c, Value *message) { /* whether an image is due */
  Value *type = member(message, L"type"), *index = member(message, L"cam_idx");
  char text[400];
  if (!type || type->type != '"') return 0;
  if (is(type->text, type->length, L"get_viewport_size")) {
    sprintf(text, "{\"viewport_size\":[%d,%d]}", ROW, H);
    say(c, text);
  } else if (is(type->text, type->length, L"get_camera_pose")) {
    if (!index || index->type != '0') return 0;
#ifndef FAINT
    if (index->number != floor(index->number) || fabs(index->number) >= 0x1p53) return 0;
#endif
#ifdef SINGLE
    long n = (int)index->number % 3;
#else
    long n = (long)index->number % 3;
#endif
    const Pose *p = &cameras[n < 0 ? n + 3 : n];
    sprintf(text, "{\"position\":[%.17g,%.17g,%.17g],\"rotation\":[%.17g,%.17g,%.17g,%.17g]}", p->p[0], p->p[1],
            p->p[2], p->q[0], p->q[1], p->q[2], p->q[3]);
    say(c, text);
  } else {
    int of_camera = is(type->text, type->length, L"camera_pose");
    Pose p;
    if (!of_camera && !is(type->text, type->length, L"point_cloud_pose")) return 0;
    if (!numbers(member(message, L"position"), L"xyz", p.p) || !numbers(member(message, L"rotation"), L"xyzw", p.q)) return 0;
    for (int i = 0; i < 3; i++)
      if (fabs(p.p[i]) > 3.4028234663852886e38) return 0;
    if (!(fabs(sqrt(dot(p.q, p.q) + p.q[3] * p.q[3]) - 1) <= 0.01)) return 0;
    if (!c->order) c->order = ++poses;
    if (!has_control(c)) return 0;
    *(of_camera ? &camera : &cloud) = p;
    return 1;
  }
  return 0;
}

static int take(Connection *c) { /* the packets that are whole; whether an image is due */
  int due = 0;
  size_t from = 0;
  while (c->had - from >= 4) {
    uint32_t length;
    memcpy(&length, c->in + from, 4);
    if (length < 1 || length > LARGEST) { drop(c); return due; }
    if (c->had - from < 4 + length) break;
    unsigned char after = c->in[from + 4 + length];
    arena_used = 0;
    at = c->in + from + 4;
    end = at + length;
    c->in[from + 4 + length] = 0;
    Value *message = c->speaks ? parse(0) : NULL;
    space();
    if (message && at == end) due |= obey(c, message);
    from += 4 + length;
    c->in[from] = after;
    c->since = now();
  }
  memmove(c->in, c->in + from, c->had -= from);
  return due;
}

static int serve(Connection *c) {
  c->in = realloc(c->in, c->had + 65536 + 1);
  ssize_t got = recv(c->fd, c->in + c->had, 65536, MSG_DONTWAIT);
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return 0;
  if (got <= 0) { drop(c); return 0; }
  if (!c->had) c->since = now();
  c->had += (size_t)got;
  return take(c);
}

static int listening(const char *variable, int otherwise) {
  const char *port = getenv(variable), *host = getenv("SPLATBUS_HOST");
  struct sockaddr_in where = {.sin_family = AF_INET, .sin_port = htons((uint16_t)(port ? atoi(port) : otherwise))};
  int fd = socket(AF_INET, SOCK_STREAM, 0);
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &(int){1}, sizeof(int));
  inet_pton(AF_INET, host ? host : "127.0.0.1", &where.sin_addr);
  if (bind(fd, (struct sockaddr *)&where, sizeof where) || listen(fd, 16)) { perror(variable); exit(1); }
  return fd;
}

static void welcome(int fd, int speaks) {
  for (Connection *c = connections + speaks * KEPT; c < connections + (speaks + 1) * KEPT; c++) {
    if (c->fd) continue;
    *c = (Connection){.fd = fd, .speaks = speaks};
    setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &(int){1}, sizeof(int));
    if (speaks) return;
    announce(c);
    return;
  }
  close(fd); /* there is no place (CHN-13) */
}

int main(void) {
  setlocale(LC_CTYPE, "C.UTF-8");
  arena = malloc(arena_size = (size_t)96 * LARGEST);
  share();
  int listeners[2] = {listening("SPLATBUS_IPC_PORT", 6001), listening("SPLATBUS_MSG_PORT", 6000)};
  for (;;) {
    struct pollfd polled[2 + 2 * KEPT];
    for (int i = 0; i < 2; i++) polled[i] = (struct pollfd){listeners[i], POLLIN, 0};
    for (int i = 0; i < 2 * KEPT; i++) {
      Connection *c = connections + i;
      polled[2 + i] = (struct pollfd){c->fd ? c->fd : -1, (short)(c->unsent ? POLLOUT : POLLIN), 0};
    }
    poll(polled, 2 + 2 * KEPT, 200);
    int due = 0;
    for (int i = 0; i < 2 * KEPT; i++) {
      Connection *c = connections + i;
      if (c->fd && polled[2 + i].revents & POLLOUT) flush(c);
      else if (c->fd && polled[2 + i].revents) due |= serve(c);
      if (c->fd && ((c->had && now() > c->since + 10) || (c->unsent && now() > c->stalled + 5))) drop(c);
    }
    if (due) draw();
    for (int i = 0; i < 2; i++)
      if (polled[i].revents) welcome(accept(listeners[i], NULL, NULL), i);
  }
}
