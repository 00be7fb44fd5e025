// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>
    /// A whole image, to be read where it lies until it is disposed of: `using (FrameLease lease = client.TakeFrame())`.
    /// The server waits with the next one for that, so copy or upload, and let go.
    /// </summary>
    /// <remarks>
    /// Rows lie bottom-up: the first row in memory is the bottom one [BUF-1], as `Texture2D.LoadRawTextureData` has them.
    /// Colour is four singles a pixel, red, green, blue, alpha; depth one [BUF-2]; what they mean is in <see cref="Packet"/>.Semantics.
    /// </remarks>
    public struct FrameLease : IDisposable
    {
        readonly Service client;
        readonly HostMemory memory;
        readonly long ticket;

        internal FrameLease(Service client, HostMemory memory, Frame frame, bool hasColor, bool hasDepth, long ticket)
        {
            this.client = client;
            this.memory = memory;
            this.ticket = ticket;
            Frame = frame;
            HasColor = hasColor;
            HasDepth = hasDepth;
        }

        /// <summary>Whether there is an image; false where none was waiting.</summary>
        public bool IsThere { get { return memory != null; } }

        /// <summary>What it was rendered with, in the axes of the wire: place your own geometry by it. Used again for the next image.</summary>
        public readonly Frame Frame;

        /// <summary>Whether colour may be read; false where it was not subscribed to [IMG-22].</summary>
        public readonly bool HasColor;

        /// <summary>Whether depth may be read; false where it was not subscribed to [IMG-22].</summary>
        public readonly bool HasDepth;

        /// <summary>Size, pitches and semantics.</summary>
        public InitPacket Packet { get { return memory.Packet; } }

        /// <summary>Whether the server still lends it: if its connection was lost while it was read, do not show it [CHN-18].</summary>
        public bool IsStillLent { get { return client.IsLent(ticket); } }

        /// <summary>Width · height · 16.</summary>
        public long ColorBytes { get { return Packet.Meta.PitchColor * Packet.Meta.H; } }

        /// <summary>Width · height · 4.</summary>
        public long DepthBytes { get { return Packet.Meta.PitchDepth * Packet.Meta.H; } }

        /// <exception cref="InvalidOperationException">It was not subscribed to.</exception>
        public IntPtr ColorPointer
        {
            get
            {
                if (!HasColor) throw new InvalidOperationException("colour was not subscribed to [IMG-22]");
                return memory.At(Packet.Ring.ColorOffset + Frame.Slot * Packet.Ring.ColorStride);
            }
        }

        /// <exception cref="InvalidOperationException">It was not subscribed to.</exception>
        public IntPtr DepthPointer
        {
            get
            {
                if (!HasDepth) throw new InvalidOperationException("depth was not subscribed to [IMG-22]");
                return memory.At(Packet.Ring.DepthOffset + Frame.Slot * Packet.Ring.DepthStride);
            }
        }

        /// <summary>All of it, four numbers a pixel, from the bottom row up.</summary>
        /// <exception cref="OverflowException">It has more numbers than a span can count.</exception>
        public unsafe ReadOnlySpan<float> Color { get { return new ReadOnlySpan<float>(ColorPointer.ToPointer(), checked((int)(ColorBytes / 4))); } }

        /// <summary>All of it, one number a pixel, from the bottom row up.</summary>
        public unsafe ReadOnlySpan<float> Depth { get { return new ReadOnlySpan<float>(DepthPointer.ToPointer(), checked((int)(DepthBytes / 4))); } }

        /// <summary>Give the slot back; the pointers and spans are not to be used any more.</summary>
        public void Dispose()
        {
            if (client != null) client.GiveBack(ticket, memory);
        }
    }
}
