// SPDX-License-Identifier: MIT
using System;
using System.Collections.Generic;
using System.Globalization;
using System.IO;
using System.Security.Cryptography;
using System.Text;
using System.Threading.Tasks;

namespace SplatBus.Adapter
{
    /// <summary>
    /// Between the conformance harness and the client: commands as JSON lines on standard input, answers
    /// on standard output (conformance/ADAPTER.md). Poses are in Unity's axes.
    /// </summary>
    static class Adapter
    {
        const int ReplySeconds = 8;
        static readonly string[] Can = { "start", "stop", "send_camera", "send_object", "ask", "subscribe", "init_packet", "pixels", "digest", "frame", "composite" };
        static readonly UTF8Encoding Utf8 = new UTF8Encoding(false);
        static readonly Stream Out = Console.OpenStandardOutput();
        static readonly PacketWriter Writer = new PacketWriter();
        static readonly Mirror Mirror = new Mirror();
        static SplatBusClient client;

        static int Main()
        {
            Greet();
            var input = new StreamReader(Console.OpenStandardInput(), Utf8);
            var json = new Json(Limits.MaxServerValues);
            for (string line; (line = input.ReadLine()) != null;)
            {
                JsonValue command = json.Read(new ArraySegment<byte>(Utf8.GetBytes(line)));
                string name = Member(command, "command").Text;
                Writer.Begin();
                Writer.Member("id", Member(command, "id").Number);
                try { Obey(name, command); }
                catch (Exception problem)
                {
                    Writer.Begin();
                    Writer.Member("id", Member(command, "id").Number);
                    Writer.Member("error", problem.GetBaseException().Message);
                }
                Line();
                if (name == "stop") return 0;
            }
            return 0;
        }

        static void Greet()
        {
            Writer.Begin();
            Writer.Member("adapter", "1");
            Writer.Name("client");
            Writer.BeginObject();
            Writer.Member("name", "splatbus-csharp");
            Writer.Member("version", "0.2.0");
            Writer.EndObject();
            Writer.Member("axes", "unity");
            Writer.Member("unitsPerMetre", 1);
            Writer.Member("precision", "double");
            Writer.Name("can");
            Writer.Texts(Can);
            Line();
        }

        static void Obey(string name, JsonValue command)
        {
            switch (name)
            {
                case "start":
                    client = new SplatBusClient(ClientOptions.FromEnvironment());
                    Mirror.Follow(client);
                    break;
                case "stop": client.Dispose(); break;
                case "send_camera": client.SendCamera(PoseOf(command)); break;
                case "send_object": client.SendObject("default", PoseOf(command)); break;
                case "ask": Ask(Member(command, "requests")); break;
                case "subscribe": Subscribe(Member(command, "channels")); break;
                case "init_packet": Announced(client.Status.Images); break;
                case "pixels": Pixels(Mirror.Newest, Member(command, "at")); break;
                case "digest": Digest(Mirror.Newest); break;
                case "frame": Told(Mirror.Newest); break;
                case "composite": Composite(Mirror.Newest, command); break;
                default: throw new ArgumentException("no such command");
            }
        }

        static Pose PoseOf(JsonValue command)
        {
            double[] position = new double[3], rotation = new double[4];
            if (!Member(command, "position").TryNumbers(position) || !Member(command, "rotation").TryNumbers(rotation)) throw new ArgumentException("no pose");
            return UnityAxes.ToWire(Pose.Of(position, rotation));
        }

        static void Ask(JsonValue requests)
        {
            var asked = new List<Task>();
            foreach (JsonValue each in requests)
                asked.Add(each.Is("viewport_size") ? (Task)client.GetViewportSizeAsync() : client.GetCameraAsync(Index(Member(each, "camera").Number)));
            if (!Task.WaitAll(asked.ToArray(), TimeSpan.FromSeconds(ReplySeconds))) throw new TimeoutException("no reply");
            Writer.Name("replies");
            Writer.BeginArray();
            foreach (Task each in asked)
            {
                Writer.BeginObject();
                var size = each as Task<ViewportSize>;
                if (size != null)
                {
                    Writer.Member("width", size.Result.ViewportSizeValue[0]);
                    Writer.Member("height", size.Result.ViewportSizeValue[1]);
                }
                else
                {
                    Camera camera = ((Task<Camera>)each).Result;
                    Placed(camera.Position, camera.Rotation);
                }
                Writer.EndObject();
            }
            Writer.EndArray();
        }

        static void Placed(double[] position, double[] rotation)
        {
            Pose pose = UnityAxes.FromWire(Pose.Of(position, rotation));
            Numbers("position", pose.X, pose.Y, pose.Z);
            Numbers("rotation", pose.QX, pose.QY, pose.QZ, pose.QW);
        }

        static long Index(double number) { return (long)number; }

        static void Subscribe(JsonValue channels)
        {
            bool color = false, depth = false;
            foreach (JsonValue each in channels)
            {
                color |= each.Is("color");
                depth |= each.Is("depth");
            }
            client.Subscribe(color, depth);
        }

        static void Announced(InitPacket packet)
        {
            Writer.Name("images");
            if (packet == null)
            {
                Writer.Null();
                return;
            }
            Semantics semantics = packet.Semantics;
            Writer.BeginObject();
            Numbers("generation", packet.Generation);
            Numbers("width", packet.Meta.W);
            Numbers("height", packet.Meta.H);
            Writer.Name("semantics");
            Writer.BeginObject();
            Writer.Member("rows", semantics.Rows);
            Writer.Member("alpha", semantics.Alpha);
            Writer.Member("colorSpace", semantics.ColorSpace);
            Writer.Name("depth");
            Writer.BeginObject();
            Writer.Member("kind", semantics.Depth.Kind);
            Writer.Member("estimator", semantics.Depth.Estimator);
            Numbers("empty", semantics.Depth.Empty);
            Writer.EndObject();
            Writer.Name("unitMetres");
            if (semantics.UnitMetres == null) Writer.Null(); else Writer.Number(semantics.UnitMetres.Value);
            Numbers("origin", semantics.Origin[0], semantics.Origin[1], semantics.Origin[2]);
            Writer.EndObject();
            Writer.EndObject();
        }

        static void Pixels(Image image, JsonValue places)
        {
            if (!Seq(image)) return;
            Writer.Name("color");
            if (image.Color == null) Writer.Null();
            else
            {
                Writer.BeginArray();
                foreach (JsonValue place in places)
                {
                    long at = 4 * image.Index(place);
                    List(image.Color[at], image.Color[at + 1], image.Color[at + 2], image.Color[at + 3]);
                }
                Writer.EndArray();
            }
            Writer.Name("depth");
            if (image.Depth == null) Writer.Null();
            else
            {
                Writer.BeginArray();
                foreach (JsonValue place in places) Number(image.Depth[image.Index(place)]);
                Writer.EndArray();
            }
        }

        static void Digest(Image image)
        {
            if (!Seq(image)) return;
            Hashed("color", image.Color, 4 * image.Width, image.Height);
            Hashed("depth", image.Depth, image.Width, image.Height);
        }

        static void Told(Image image)
        {
            if (!Seq(image)) return;
            FrameCamera camera = image.Camera;
            Writer.Name("camera");
            Writer.BeginObject();
            Placed(camera.Position, camera.Rotation);
            Numbers("fx", camera.Fx);
            Numbers("fy", camera.Fy);
            Numbers("cx", camera.Cx);
            Numbers("cy", camera.Cy);
            Numbers("width", camera.Width);
            Numbers("height", camera.Height);
            Numbers("near", camera.Near);
            Numbers("far", camera.Far);
            Writer.EndObject();
            Numbers("time", image.Time);
            Writer.Name("objects");
            Writer.BeginArray();
            foreach (Placement each in image.Objects)
            {
                Writer.BeginObject();
                Writer.Member("object", each.Object);
                Placed(each.Position, each.Rotation);
                Numbers("scale", each.Scale);
                Writer.EndObject();
            }
            Writer.EndArray();
        }

        static void Composite(Image image, JsonValue command)
        {
            if (image == null || image.Color == null || image.Depth == null)
            {
                Seq(null);
                return;
            }
            Seq(image);
            var own = new double[3];
            Member(command, "color").TryNumbers(own);
            JsonValue behind = Member(command, "depth");
            float ownDepth = behind.Kind == JsonKind.Number ? (float)behind.Number : float.PositiveInfinity;
            bool isStraight = image.Semantics.Alpha == SemanticsAlpha.Straight;
            Writer.Name("color");
            Writer.BeginArray();
            foreach (JsonValue place in Member(command, "at"))
            {
                long at = image.Index(place);
                float alpha = image.Color[4 * at + 3], depth = image.PlanarDepth(place);
                Writer.BeginArray();
                for (int i = 0; i < 3; i++) Number(Compositing.Over(image.Color[4 * at + i], alpha, depth, isStraight, (float)own[i], ownDepth));
                Writer.EndArray();
            }
            Writer.EndArray();
        }

        static bool Seq(Image image)
        {
            Writer.Name("seq");
            if (image == null) Writer.Null(); else Writer.Integer(image.Seq);
            return image != null;
        }

        /// <summary>SHA-256 of rows from the top; in memory the bottom one is first.</summary>
        static void Hashed(string name, float[] numbers, long rowNumbers, long rows)
        {
            Writer.Name(name);
            if (numbers == null)
            {
                Writer.Null();
                return;
            }
            using (SHA256 sha = SHA256.Create())
            {
                var row = new byte[4 * rowNumbers];
                for (long i = rows - 1; i >= 0; i--)
                {
                    Buffer.BlockCopy(numbers, checked((int)(i * row.Length)), row, 0, row.Length);
                    sha.TransformBlock(row, 0, row.Length, row, 0);
                }
                sha.TransformFinalBlock(row, 0, 0);
                Writer.Text(BitConverter.ToString(sha.Hash).Replace("-", "").ToLowerInvariant());
            }
        }

        static JsonValue Member(JsonValue parent, string name)
        {
            JsonValue member;
            if (!parent.TryMember(name, out member)) throw new ArgumentException("no member " + name);
            return member;
        }

        static void Numbers(string name, params double[] values)
        {
            Writer.Name(name);
            if (values.Length == 1) Number(values[0]); else List(values);
        }

        static void List(params double[] values)
        {
            Writer.BeginArray();
            foreach (double each in values) Number(each);
            Writer.EndArray();
        }

        static void Number(double value)
        {
            if (double.IsNaN(value) || double.IsInfinity(value)) Writer.Text(double.IsNaN(value) ? "nan" : value > 0 ? "inf" : "-inf");
            else Writer.Number(value);
        }

        static void Line()
        {
            ArraySegment<byte> packet = Writer.End();
            Out.Write(packet.Array, packet.Offset + Framing.HeaderBytes, packet.Count - Framing.HeaderBytes);
            Out.WriteByte((byte)'\n');
            Out.Flush();
        }
    }
}
