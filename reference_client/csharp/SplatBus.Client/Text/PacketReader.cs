// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>
    /// Finds packets in the bytes of one direction of one connection [FRM-1, FRM-4]; it does no I/O,
    /// and allocates only for a packet that is longer than every one before it.
    /// </summary>
    public sealed class PacketReader
    {
        byte[] buffer = new byte[4096];
        int begin, end;
        long passed;

        /// <summary>Whether the stream stands between two packets, where it may end [FRM-6].</summary>
        public bool IsBetweenPackets { get { return begin == end; } }

        /// <summary>Where the next bytes are to be received; valid until the next call. Never empty.</summary>
        public ArraySegment<byte> Room()
        {
            if (begin == end) MoveToFront();
            if (end == buffer.Length) MoveToFront();
            int wanted = Math.Max(Announced() + 1, end + 1);
            if (wanted > buffer.Length) Array.Resize(ref buffer, Math.Max(wanted, 2 * buffer.Length));
            return new ArraySegment<byte>(buffer, end, buffer.Length - end);
        }

        /// <summary>Say how many bytes were put there.</summary>
        public void Received(int count)
        {
            end += count;
        }

        /// <summary>The payload of the next whole packet, valid until the next call of <see cref="Room"/>.</summary>
        /// <exception cref="ProtocolException">Its length is 0 or too large: close [FRM-3].</exception>
        public bool Next(out ArraySegment<byte> payload)
        {
            payload = default(ArraySegment<byte>);
            int size = Announced();
            if (size == 0 || end - begin < size) return false;
            payload = new ArraySegment<byte>(buffer, begin + Framing.HeaderBytes, size - Framing.HeaderBytes);
            begin += size;
            passed += size;
            return true;
        }

        /// <summary>Bytes of the packet that begins here, header included; 0 before it is known.</summary>
        int Announced()
        {
            if (end - begin < Framing.HeaderBytes) return 0;
            uint length = (uint)(buffer[begin] | buffer[begin + 1] << 8 | buffer[begin + 2] << 16 | buffer[begin + 3] << 24);
            if (length < Limits.MinPayloadBytes || length > Limits.MaxPayloadBytes)
                throw new ProtocolException("a packet of " + length + " bytes is announced [FRM-3]", passed);
            return (int)(length + Framing.HeaderBytes);
        }

        void MoveToFront()
        {
            Buffer.BlockCopy(buffer, begin, buffer, 0, end - begin);
            end -= begin;
            begin = 0;
        }
    }
}
