// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>What came from the other side breaks a rule; the message names it and the place.</summary>
    public sealed class ProtocolException : Exception
    {
        /// <param name="what">A sentence, with the requirement in brackets.</param>
        /// <param name="offset">Where: a byte of the payload, or of the stream for a header.</param>
        public ProtocolException(string what, long offset) : base(what + " at byte " + offset)
        {
            Offset = offset;
        }

        /// <param name="pointer">Where: a JSON pointer into the message.</param>
        public ProtocolException(string what, string pointer) : base("'" + pointer + "' " + what)
        {
            Offset = -1;
        }

        /// <summary>The byte; -1 where a member is named instead.</summary>
        public long Offset { get; private set; }
    }

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
            payload = new ArraySegment<byte>(buffer, begin + (int)Framing.HeaderBytes, size - (int)Framing.HeaderBytes);
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
