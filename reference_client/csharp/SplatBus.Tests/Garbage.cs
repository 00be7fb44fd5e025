// SPDX-License-Identifier: MIT
using System;

namespace SplatBus.Tests
{
    /// <summary>What the frame loop allocates: a `frame` is read, and a pose and a `release` are written.</summary>
    static class Garbage
    {
        const int Frames = 10000;

        static readonly PacketReader Reader = new PacketReader();
        static readonly Json Text = new Json(Limits.MaxServerValues);
        static readonly PacketWriter Writer = new PacketWriter();
        static readonly double[] P = new double[3], Q = new double[4];

        /// <summary>Print how many bytes so many frames left behind, once a first one was read.</summary>
        internal static int Measure(byte[] packet)
        {
            Frame(packet);
            long before = GC.GetAllocatedBytesForCurrentThread();
            for (int i = 0; i < Frames; i++) Frame(packet);
            long left = GC.GetAllocatedBytesForCurrentThread() - before;
            Console.WriteLine("{0} frames, {1} bytes", Frames, left);
            return 0;
        }

        static void Frame(byte[] packet)
        {
            ArraySegment<byte> payload;
            for (int at = 0; at < packet.Length;)
            {
                ArraySegment<byte> room = Reader.Room();
                int some = Math.Min(room.Count, packet.Length - at);
                Buffer.BlockCopy(packet, at, room.Array, room.Offset, some);
                Reader.Received(some);
                at += some;
            }
            if (!Reader.Next(out payload)) throw new InvalidOperationException("not a whole packet");
            JsonValue frame = Text.Read(payload), camera, position, rotation, generation, seq;
            long number;
            if (!frame.TryMember("camera", out camera) || !camera.TryMember("position", out position) || !camera.TryMember("rotation", out rotation)
                || !frame.TryMember("generation", out generation) || !frame.TryMember("seq", out seq))
                throw new InvalidOperationException("no frame");
            if (!position.TryNumbers(P) || !rotation.TryNumbers(Q)) throw new InvalidOperationException("no pose");
            var pose = new Pose { X = P[0], Y = P[1], Z = P[2], QX = Q[0], QY = Q[1], QZ = Q[2], QW = Q[3] };
            Send(UnityAxes.FromWire(pose));
            Writer.Begin();
            Writer.Name("type");
            Writer.Text("release");
            Writer.Name("generation");
            Writer.Integer(generation.TryInteger(out number) ? number : 0);
            Writer.Name("seq");
            Writer.Integer(seq.TryInteger(out number) ? number : 0);
            Writer.End();
        }

        static void Send(Pose pose)
        {
            Writer.Begin();
            Writer.Name("type");
            Writer.Text("camera_pose");
            Writer.Name("position");
            Writer.BeginArray();
            Writer.Number(pose.X);
            Writer.Number(pose.Y);
            Writer.Number(pose.Z);
            Writer.EndArray();
            Writer.Name("rotation");
            Writer.BeginArray();
            Writer.Number(pose.QX);
            Writer.Number(pose.QY);
            Writer.Number(pose.QZ);
            Writer.Number(pose.QW);
            Writer.EndArray();
            Writer.End();
        }
    }
}
