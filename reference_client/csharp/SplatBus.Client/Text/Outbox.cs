// SPDX-License-Identifier: MIT
using System;

namespace SplatBus
{
    /// <summary>Packets of one connection that wait until TCP takes them, in the order in which they were written.</summary>
    public sealed class Outbox
    {
        byte[] bytes = new byte[1024];
        int begin, end;

        /// <summary>Write a packet with it, then <see cref="Add"/>.</summary>
        public readonly PacketWriter Writer = new PacketWriter();

        public bool IsEmpty { get { return begin == end; } }

        /// <summary>What TCP has not taken yet.</summary>
        public ArraySegment<byte> Waiting { get { return new ArraySegment<byte>(bytes, begin, end - begin); } }

        /// <summary>Begin a message of this type.</summary>
        public PacketWriter Begin(string type)
        {
            Writer.Begin();
            Writer.Member("type", type);
            return Writer;
        }

        /// <summary>End the message that was begun; it waits from now on.</summary>
        public void Add()
        {
            ArraySegment<byte> packet = Writer.End();
            if (bytes.Length - end < packet.Count)
            {
                Buffer.BlockCopy(bytes, begin, bytes, 0, end - begin);
                end -= begin;
                begin = 0;
                if (bytes.Length - end < packet.Count) Array.Resize(ref bytes, Math.Max(2 * bytes.Length, end + packet.Count));
            }
            Buffer.BlockCopy(packet.Array, packet.Offset, bytes, end, packet.Count);
            end += packet.Count;
        }

        /// <summary>Say how many bytes TCP took.</summary>
        public void Taken(int count)
        {
            begin += count;
            if (begin == end) begin = end = 0;
        }
    }
}
