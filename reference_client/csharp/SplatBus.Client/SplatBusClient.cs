// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;
using System.Threading.Tasks;

namespace SplatBus
{
    /// <summary>
    /// A client of SplatBus 1.1 and 1.0: both channels on a thread of its own, which comes back when the
    /// server does. Its methods may be called from any thread, and none of them waits.
    /// </summary>
    public sealed class SplatBusClient : IDisposable
    {
        readonly Service service;

        /// <exception cref="ArgumentException">A name or the token is longer than may be said [NEG-2].</exception>
        public SplatBusClient(ClientOptions options)
        {
            CheckText(options.Name, 0, Limits.MaxNameChars);
            CheckText(options.Version, 0, Limits.MaxNameChars);
            if (options.Token != null) CheckText(options.Token, 1, Limits.MaxTokenChars);
            service = new Service(options);
        }

        /// <summary>What it is connected to, and what is wrong.</summary>
        public ClientStatus Status { get { return service.Status; } }

        /// <summary>The image that waits to be read; `IsThere` is false where none does.</summary>
        public FrameLease TakeFrame() { return service.Take(TimeSpan.Zero); }

        /// <summary>The same, and wait until one comes, or for so long at most.</summary>
        public FrameLease TakeFrame(TimeSpan limit) { return service.Take(limit); }

        /// <summary>Look from there; the newest counts. Once per refresh of the display is enough [POS-12].</summary>
        /// <param name="pose">Camera-to-world in the axes of the wire, see <see cref="UnityAxes"/>.</param>
        /// <param name="lens">Null to leave the lens as it is.</param>
        /// <param name="tag">1 to 64 characters that come back with the image; or null.</param>
        /// <exception cref="ArgumentException">No server takes it [POS-2, POS-3, CAM-1, CAM-4].</exception>
        public void SendCamera(Pose pose, Intrinsics lens = null, string tag = null)
        {
            Check(pose.Wrong);
            Check(lens == null ? null : Lenses.Wrong(lens));
            if (tag != null) CheckText(tag, 1, Limits.MaxTagChars);
            lock (service.Gate)
            {
                service.Wishes.Camera(pose, lens, tag);
                service.Say();
            }
        }

        /// <summary>Move an object of the scene.</summary>
        /// <param name="id">One of <see cref="GetSceneAsync"/>; "default" is the main one.</param>
        /// <param name="pose">Object-to-world in the axes of the wire.</param>
        /// <param name="scale">The same along all axes, 0.000001 to 1,000,000.</param>
        /// <exception cref="ArgumentException">No server takes it [POS-2, POS-3, OBJ-1].</exception>
        public void SendObject(string id, Pose pose, double scale = 1)
        {
            Check(pose.Wrong);
            CheckText(id, 1, Limits.MaxTagChars);
            Check(scale >= Limits.MinScale && scale <= Limits.MaxScale ? null : "a scale beyond 1e-6 to 1e6 [OBJ-1]");
            lock (service.Gate)
            {
                service.Wishes.Object(id, pose, scale);
                service.Say();
            }
        }

        /// <summary>Render the scene at this time, in seconds.</summary>
        /// <exception cref="ArgumentException">It is not finite.</exception>
        public void SendTime(double seconds)
        {
            Check(double.IsNaN(seconds) || double.IsInfinity(seconds) ? "a time that is not finite [TIM-1]" : null);
            lock (service.Gate)
            {
                service.Wishes.Time(seconds);
                service.Say();
            }
        }

        /// <summary>What images have to hold; at least one of both.</summary>
        public void Subscribe(bool color, bool depth)
        {
            Check(color || depth ? null : "neither colour nor depth [IMG-19]");
            service.Subscribe(color, depth);
        }

        /// <summary>Be sent telemetry, as <see cref="TelemetryEvent"/>.</summary>
        /// <param name="names">Of the series; null for all, none for none.</param>
        /// <exception cref="ArgumentException">No server takes it [TEL-1].</exception>
        public void SubscribeTelemetry(params string[] names)
        {
            if (names != null)
            {
                Check(names.Length <= Limits.MaxSeries ? null : "more than 256 series [TEL-1]");
                Check(new HashSet<string>(names).Count == names.Length ? null : "a series twice [TEL-1]");
                foreach (string each in names) CheckText(each, 1, Limits.MaxNameChars);
            }
            lock (service.Gate)
            {
                service.Wishes.Telemetry(names);
                service.Say();
            }
        }

        /// <summary>The size of the images; 0, 0 while there are none.</summary>
        public Task<ViewportSize> GetViewportSizeAsync()
        {
            return service.Ask(new Request<ViewportSize> { Type = "get_viewport_size", Reply = "viewport_size", Read = Replies.Size });
        }

        /// <summary>A camera that the scene comes with.</summary>
        public Task<Camera> GetCameraAsync(long index)
        {
            Check(Math.Abs(index) <= Limits.MaxSafeInteger ? null : "an index beyond 2^53 - 1 [REQ-2]");
            return service.Ask(new Request<Camera>
            {
                Type = "get_camera_pose", Reply = "camera", Read = Replies.Camera,
                Members = writer => writer.Member("cam_idx", index),
            });
        }

        /// <summary>What the scene consists of.</summary>
        public Task<Scene> GetSceneAsync()
        {
            return service.Ask(new Request<Scene> { Type = "get_scene", Reply = "scene", Capability = Capability.Scene, Read = Replies.Scene });
        }

        /// <summary>Ask for images of another size; RefusedException where the server does not give it.</summary>
        public Task<ViewportSize> SetViewportAsync(int width, int height)
        {
            Check(width >= 1 && height >= 1 && width <= Limits.MaxImageSize && height <= Limits.MaxImageSize ? null : "a size beyond 1 to 32768 [VPT-1]");
            return service.Ask(new Request<ViewportSize>
            {
                Type = "set_viewport", Reply = "viewport_size", Capability = Capability.Viewport, Read = Replies.Size,
                Members = writer => { writer.Member("width", width); writer.Member("height", height); },
            });
        }

        /// <summary>The server's clock, that of `renderedAt`; `T` is this client's when it asked, in seconds.</summary>
        public Task<Pong> PingAsync()
        {
            return service.Ask(new Request<Pong>
            {
                Type = "ping", Reply = "pong", Capability = Capability.Ping, Read = Replies.Pong,
                Members = writer => writer.Member("t", Service.Now),
            });
        }

        /// <summary>Take the oldest event that nobody has taken; of many the oldest are dropped.</summary>
        public bool TryTakeEvent(out ClientEvent taken) { return service.TryTakeEvent(out taken); }

        /// <summary>End both connections. Leases that are held stay readable until they are disposed of.</summary>
        public void Dispose() { service.Dispose(); }

        static void Check(string wrong)
        {
            if (wrong != null) throw new ArgumentException(wrong);
        }

        static void CheckText(string text, int least, int most)
        {
            Check(text.Length >= least && text.Length <= most ? null : "a name of " + text.Length + " characters, not " + least + " to " + most);
            for (int i = 0; i < text.Length; i++)
                if (char.IsSurrogatePair(text, i)) i++;
                else Check(char.IsSurrogate(text[i]) ? "a name with half a surrogate pair [JSN-1]" : null);
        }
    }
}
