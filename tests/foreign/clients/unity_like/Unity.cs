// A scene of Unity without Unity: a script that steers, and a plug-in that reads images.
using System;
using System.Collections.Generic;
using System.Diagnostics;
using System.Globalization;
using System.Net;
using System.Net.Sockets;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;
using Members = System.Collections.Generic.Dictionary<string, object>;

class Lost : Exception { public Lost(string why) : base(why) { } }

class Link
{
    const int Most = 1 << 20;
    readonly Socket socket;
    byte[] buffer = new byte[1 << 16];
    int have;
    double since;

    public Link(string variable, int usual)
    {
        string host = Environment.GetEnvironmentVariable("SPLATBUS_HOST") ?? "127.0.0.1";
        string port = Environment.GetEnvironmentVariable(variable);
        socket = new Socket(AddressFamily.InterNetwork, SocketType.Stream, ProtocolType.Tcp);
        try { socket.Connect(IPAddress.Parse(host), port == null ? usual : int.Parse(port)); }
        catch { socket.Close(); throw; }
        socket.NoDelay = true;
    }

    public void Close() { socket.Close(); }

    public void Send(string text)
    {
        byte[] payload = Encoding.UTF8.GetBytes(text), header = BitConverter.GetBytes(payload.Length);
        socket.Send(header);
        socket.Send(payload);
    }

    // The next packet, or null if none is whole after so many seconds.
    public byte[] Next(double seconds)
    {
        double until = Scene.Now + seconds;
        for (;;)
        {
            long length = BitConverter.ToUInt32(buffer, 0);
            if (have >= 4 && (length < 1 || length > Most)) throw new Lost("a length of " + length);
            if (have >= 4 && have >= 4 + length)
            {
                var payload = new byte[length];
                Array.Copy(buffer, 4, payload, 0, (int)length);
                have -= 4 + (int)length;
                Array.Copy(buffer, 4 + (int)length, buffer, 0, have);
                since = Scene.Now;
                return payload;
            }
            if (have > 0 && Scene.Now > since + 10) throw new Lost("half a packet");
            double left = until - Scene.Now;
            if (!socket.Poll(left > 0 ? (int)(1e6 * left) : 0, SelectMode.SelectRead)) return null;
            if (have == buffer.Length) Array.Resize(ref buffer, Math.Min(2 * have, Most + 4));
            int got = socket.Receive(buffer, have, buffer.Length - have, SocketFlags.None);
            if (got == 0) throw new Lost("the end of the stream");
            if (have == 0) since = Scene.Now;
            have += got;
        }
    }
}

unsafe struct Handle { public fixed byte Bytes[64]; }

// What the native plug-in does: images out of the memory of another process.
unsafe class Pictures
{
    const string Cuda = "libcudart.so.12";
    [DllImport(Cuda)] static extern int cudaSetDevice(int device);
    [DllImport(Cuda)] static extern int cudaIpcOpenMemHandle(out IntPtr memory, Handle handle, uint flags);
    [DllImport(Cuda)] static extern int cudaIpcCloseMemHandle(IntPtr memory);
    [DllImport(Cuda)] static extern int cudaIpcOpenEventHandle(out IntPtr done, Handle handle);
    [DllImport(Cuda)] static extern int cudaEventDestroy(IntPtr done);
    [DllImport(Cuda)] static extern int cudaStreamWaitEvent(IntPtr stream, IntPtr done, uint flags);
    [DllImport(Cuda)] static extern int cudaStreamSynchronize(IntPtr stream);
    [DllImport(Cuda)] static extern int cudaMemcpy2DAsync(IntPtr to, UIntPtr toPitch, IntPtr from, UIntPtr fromPitch,
        UIntPtr width, UIntPtr height, int kind, IntPtr stream);

    long width, height, colourAt, depthAt;
    IntPtr colour, depth, done, pixels, distances;

    // Null where the packet describes nothing that can be opened.
    public static Pictures Open(Members packet)
    {
        object member;
        if (packet.ContainsKey("type") || !packet.TryGetValue("meta", out member) || !(member is Members)) return null;
        var made = new Pictures();
        try { if (made.Opens(packet, (Members)member)) return made; }
        catch (FormatException) { }
        catch (KeyNotFoundException) { }
        catch (InvalidCastException) { }
        catch (OutOfMemoryException) { }
        catch (DllNotFoundException) { }
        made.Close();
        return null;
    }

    bool Opens(Members packet, Members meta)
    {
        width = Whole(meta["w"], 1, 32768);
        height = Whole(meta["h"], 1, 32768);
        if (Whole(meta["pitchColor"], 1, 1 << 20) != 16 * width || Whole(meta["pitchDepth"], 1, 1 << 20) != 4 * width) return false;
        if ((string)meta["fmtColor"] != "RGBA32F" || (string)meta["fmtDepth"] != "R32F") return false;
        colourAt = Optional(meta, "offsetColor", 16);
        depthAt = Optional(meta, "offsetDepth", 4);
        long device = Optional(meta, "device", 1);
        Handle ofColour = Key(packet["mem_color"]), ofDepth = Key(packet["mem_depth"]), ofDone = Key(packet["evt_done"]);
        if (device > 1000 || cudaSetDevice((int)device) != 0) return false;
        if (cudaIpcOpenMemHandle(out colour, ofColour, 1) != 0) return false;
        if ((string)packet["mem_color"] == (string)packet["mem_depth"] || Same(ofColour, ofDepth)) depth = colour;
        else if (cudaIpcOpenMemHandle(out depth, ofDepth, 1) != 0) return false;
        if (cudaIpcOpenEventHandle(out done, ofDone) != 0) return false;
        pixels = Marshal.AllocHGlobal((IntPtr)(16 * width * height));
        distances = Marshal.AllocHGlobal((IntPtr)(4 * width * height));
        return true;
    }

    static bool Same(Handle one, Handle other)
    {
        for (int i = 0; i < 64; i++) if (one.Bytes[i] != other.Bytes[i]) return false;
        return true;
    }

    static long Whole(object value, double least, double most)
    {
        if (!(value is double)) throw new FormatException();
        double number = (double)value;
        if (Math.Floor(number) != number || number < least || number > most) throw new FormatException();
        return (long)number;
    }

    static long Optional(Members meta, string name, long unit)
    {
        object value;
        if (!meta.TryGetValue(name, out value)) return 0;
        long number = Whole(value, 0, 9007199254740991);
        if (number % unit != 0) throw new FormatException();
        return number;
    }

    static Handle Key(object value)
    {
        string text = value as string;
        if (text == null || text.Length != 88) throw new FormatException();
        foreach (char each in text) if (char.IsWhiteSpace(each)) throw new FormatException();
        byte[] bytes = Convert.FromBase64String(text);
        if (bytes.Length != 64) throw new FormatException();
        var handle = new Handle();
        for (int i = 0; i < 64; i++) handle.Bytes[i] = bytes[i];
        return handle;
    }

    // One image, whole: behind the event, and done when it returns.
    public bool Read()
    {
        return cudaStreamWaitEvent(IntPtr.Zero, done, 0) == 0
            && Copy(pixels, colour, colourAt, 16 * width) && Copy(distances, depth, depthAt, 4 * width)
            && cudaStreamSynchronize(IntPtr.Zero) == 0;
    }

    bool Copy(IntPtr to, IntPtr from, long offset, long row)
    {
        var pitch = (UIntPtr)(ulong)row;
        return cudaMemcpy2DAsync(to, pitch, (IntPtr)(from.ToInt64() + offset), pitch, pitch, (UIntPtr)(ulong)height, 2, IntPtr.Zero) == 0;
    }

    public void Close()
    {
        if (colour != IntPtr.Zero || done != IntPtr.Zero) cudaStreamSynchronize(IntPtr.Zero);
        if (depth != IntPtr.Zero && depth != colour) cudaIpcCloseMemHandle(depth);
        if (colour != IntPtr.Zero) cudaIpcCloseMemHandle(colour);
        if (done != IntPtr.Zero) cudaEventDestroy(done);
        Marshal.FreeHGlobal(pixels);
        Marshal.FreeHGlobal(distances);
    }
}

static class Scene
{
    const int Width = 320, Height = 180;
    static readonly Stopwatch clock = Stopwatch.StartNew();
    static volatile bool imagesOn, scriptOn;
    public static double Now { get { return clock.Elapsed.TotalSeconds; } }

    static void Main()
    {
        for (;;) // one after the other, three times each: a plug-in first, then its script
        {
            if (!imagesOn) Try("SPLATBUS_IPC_PORT", 6001, link => { imagesOn = true; return () => { Watch(link); imagesOn = false; }; });
            if (!scriptOn) Try("SPLATBUS_MSG_PORT", 6000, link => { scriptOn = true; return () => { Steer(link); scriptOn = false; }; });
            Thread.Sleep(200);
        }
    }

    static void Try(string variable, int usual, Func<Link, ThreadStart> begin)
    {
        for (int i = 0; i < 3; i++)
        {
            try
            {
                var run = begin(new Link(variable, usual));
                new Thread(run) { IsBackground = true }.Start();
                return;
            }
            catch (SocketException) { Thread.Sleep(250); }
        }
    }

    static void Watch(Link link)
    {
        Pictures shown = null;
        try
        {
            for (;;)
            {
                byte[] packet = link.Next(shown == null ? 1.0 : 0.02);
                if (packet == null && shown != null && !shown.Read()) { shown.Close(); shown = null; }
                if (packet == null || shown != null) continue;
                try { shown = Pictures.Open(Json.Object(packet)); }
                catch (FormatException) { }
            }
        }
        catch (Lost) { }
        catch (SocketException) { }
        if (shown != null) shown.Close();
        link.Close();
    }

    static void Steer(Link link)
    {
        try
        {
            link.Send("{\"type\":\"get_camera_pose\",\"cam_idx\":0}");
            var camera = Reply(link);
            float x = Numbers(camera, "position", 3)[0], y = -Numbers(camera, "position", 3)[1], z = Numbers(camera, "position", 3)[2];
            double norm = 0;
            foreach (float each in Numbers(camera, "rotation", 4)) norm += (double)each * each;
            if (Math.Abs(Math.Sqrt(norm) - 1) > 0.01) throw new FormatException();
            for (;;)
            {
                link.Send("{\"type\":\"get_viewport_size\",\"timestamp\":" + Spelt(Now) + "}");
                float[] size = Numbers(Reply(link), "viewport_size", 2);
                if (size[0] == Width && size[1] == Height) break;
                foreach (float each in size) if (each < 0 || each > 32768 || each != (int)each) throw new FormatException();
                if (size[0] != 0 || size[1] != 0) Environment.Exit(0); // leaves Play mode
                Thread.Sleep(300);
            }
            for (float turn = 0; ; turn += 0.01f)
            {
                float half = turn / 2;
                link.Send(Pose("camera_pose", x + 0.1f * (float)Math.Sin(turn), -y, z, -0.0f, -(float)Math.Sin(half), (float)Math.Cos(half)));
                link.Send(Pose("point_cloud_pose", 0, -0.0f, 0, -0.0f, 0, 1));
                link.Next(0.03); // nobody is asked, so what comes is nothing
            }
        }
        catch (Lost) { }
        catch (SocketException) { }
        catch (FormatException) { }
        link.Close();
    }

    static Members Reply(Link link)
    {
        byte[] payload = link.Next(9);
        if (payload == null) throw new Lost("no reply");
        return Json.Object(payload);
    }

    static float[] Numbers(Members of, string name, int count)
    {
        object member;
        var items = of.TryGetValue(name, out member) ? member as List<object> : null;
        if (items == null || items.Count != count) throw new FormatException();
        return items.ConvertAll(each =>
        {
            if (!(each is double) || Math.Abs((double)each) > float.MaxValue) throw new FormatException();
            return (float)(double)each;
        }).ToArray();
    }

    static string Pose(string type, float x, float y, float z, float a, float b, float w)
    {
        return "{\"type\":\"" + type + "\",\"timestamp\":" + Spelt(Now)
            + ",\"position\":{\"x\":" + Spelt(x) + ",\"y\":" + Spelt(y) + ",\"z\":" + Spelt(z)
            + "},\"rotation\":{\"x\":" + Spelt(a) + ",\"y\":" + Spelt(b) + ",\"z\":0.0,\"w\":" + Spelt(w) + "}}";
    }

    static string Spelt(double value) { return value.ToString("R", CultureInfo.InvariantCulture); }
}
