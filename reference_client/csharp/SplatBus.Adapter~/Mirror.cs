// SPDX-License-Identifier: MIT
using System;
using System.Threading;

namespace SplatBus.Adapter
{
    /// <summary>A copy of an image, rows from the bottom up.</summary>
    sealed class Image
    {
        internal long Seq, Width, Height;
        /// <summary>Null where it was not subscribed to.</summary>
        internal float[] Color, Depth;
        internal Semantics Semantics;
        internal FrameCamera Camera;
        internal Placement[] Objects;
        internal double Time;

        /// <summary>Of the pixel at [column from the left, row from the top].</summary>
        internal long Index(JsonValue place)
        {
            var at = new double[2];
            if (!place.TryNumbers(at) || at[0] < 0 || at[0] >= Width || at[1] < 0 || at[1] >= Height) throw new ArgumentException("no pixel of the image");
            return (Height - 1 - (long)at[1]) * Width + (long)at[0];
        }

        internal float PlanarDepth(JsonValue place)
        {
            var at = new double[2];
            long index = Index(place);
            place.TryNumbers(at);
            return Compositing.PlanarDepth(Depth[index], Color[4 * index + 3], Semantics, Camera, (int)at[0], (int)at[1]);
        }
    }

    /// <summary>Reads each image as it comes, and keeps a copy of the newest.</summary>
    sealed class Mirror
    {
        static readonly TimeSpan Patience = TimeSpan.FromSeconds(0.1);

        volatile Image newest;

        internal Image Newest { get { return newest; } }

        internal void Follow(SplatBusClient client)
        {
            new Thread(() => { while (true) Read(client); }) { IsBackground = true }.Start();
        }

        void Read(SplatBusClient client)
        {
            using (FrameLease lease = client.TakeFrame(Patience))
            {
                if (!lease.IsThere) return;
                Image copy = Copy(lease);
                if (lease.IsStillLent) newest = copy;
            }
        }

        static Image Copy(FrameLease lease)
        {
            FrameCamera camera = lease.Frame.Camera;
            return new Image
            {
                Seq = lease.Frame.Seq,
                Width = lease.Packet.Meta.W,
                Height = lease.Packet.Meta.H,
                Color = lease.HasColor ? lease.Color.ToArray() : null,
                Depth = lease.HasDepth ? lease.Depth.ToArray() : null,
                Semantics = lease.Packet.Semantics,
                Camera = new FrameCamera
                {
                    Position = (double[])camera.Position.Clone(),
                    Rotation = (double[])camera.Rotation.Clone(),
                    Fx = camera.Fx,
                    Fy = camera.Fy,
                    Cx = camera.Cx,
                    Cy = camera.Cy,
                    Width = camera.Width,
                    Height = camera.Height,
                    Near = camera.Near,
                    Far = camera.Far,
                },
                Objects = Array.ConvertAll(lease.Frame.Objects ?? new Placement[0], Copy),
                Time = lease.Frame.Time,
            };
        }

        static Placement Copy(Placement it)
        {
            return new Placement { Object = it.Object, Position = (double[])it.Position.Clone(), Rotation = (double[])it.Rotation.Clone(), Scale = it.Scale };
        }
    }
}
