// SPDX-License-Identifier: MIT
namespace SplatBus.Unity
{
    using System.Threading.Tasks;

    /// <summary>Asks the server for images as large as the camera's: one request at a time, and not too often.</summary>
    sealed class SizeRequests
    {
        const double BusyPause = 0.5, FailurePause = 1, Ever = double.PositiveInfinity;

        Task<ViewportSize> asked;
        int askedWidth, askedHeight;
        /// <summary>In seconds: when to ask at the soonest, and when for the same size.</summary>
        double soonest, again;

        /// <summary>Of the images that the server has, or will have soon; 0 while unknown.</summary>
        internal int Width { get; private set; }
        internal int Height { get; private set; }
        internal bool IsUnderWay { get { return asked != null; } }
        internal string Problem { get; private set; }

        internal void Forget()
        {
            asked = null;
            Width = Height = askedWidth = askedHeight = 0;
            soonest = again = 0;
            Problem = null;
        }

        /// <param name="packet">The memory that is open, or null.</param>
        internal void ImagesAre(InitPacket packet)
        {
            Width = packet == null ? 0 : (int)packet.Meta.W;
            Height = packet == null ? 0 : (int)packet.Meta.H;
        }

        /// <summary>The server is another, perhaps.</summary>
        internal void AskAgain()
        {
            again = 0;
            Problem = null;
        }

        /// <param name="asks">Whether to ask at all.</param>
        /// <param name="now">Seconds.</param>
        internal void Turn(SplatBusClient client, bool asks, int width, int height, double now)
        {
            if (asked != null && !asked.IsCompleted) return;
            if (asked != null) Hear(now);
            if (!asks || Width == 0 || width < 1 || height < 1 || width > Limits.MaxImageSize || height > Limits.MaxImageSize) return;
            bool isNew = width != askedWidth || height != askedHeight;
            bool fits = width == Width && height == Height;
            if (isNew || fits) Problem = null;
            if (fits || now < soonest || (!isNew && now < again)) return;
            askedWidth = width;
            askedHeight = height;
            soonest = now + Limits.AskAgainMinSeconds;
            asked = client.SetViewportAsync(width, height);
        }

        void Hear(double now)
        {
            Task<ViewportSize> answered = asked;
            asked = null;
            soonest = now + Limits.AskAgainMinSeconds; // after `busy` no sooner [VPT-9]
            again = now + FailurePause;
            if (answered.Exception == null)
            {
                Width = askedWidth;
                Height = askedHeight;
                return;
            }
            var refused = answered.Exception.InnerException as RefusedException;
            if (refused == null) return; // the connection, of which others tell
            bool isBusy = refused.Error.Code == ErrorCode.Busy;
            again = isBusy ? now + BusyPause : Ever;
            Problem = "the server does not give images of " + askedWidth + " x " + askedHeight + ": " + refused.Message;
        }
    }
}
